"""Meshes of one time, and folders of them, as other programs read them."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from ripple_sim import (
    Exporter,
    ExportOptions,
    RippleError,
    Ripples,
    Scene,
    Simulation,
    export_scene,
)
from ripple_sim.overlay.color_map import colors
from ripple_sim.render.tone_mapping import srgb_to_linear

TIME = 0.0335  # two frames and three and a half steps [s]


def heights_of(path: Path) -> np.ndarray:
    """The property `height` of the vertices of a PLY."""
    elements = trimesh.load(path, process=False).metadata["_ply_raw"]
    return elements["vertex"]["data"]["height"].ravel()


@pytest.fixture(scope="module")
def shown(scene: Scene) -> Simulation:
    """The scene at the time, by steps alone."""
    simulation = Simulation(scene, backend="cpu")
    while simulation.data.time < TIME - simulation.model.opt.timestep / 2:
        simulation.step()
    return simulation


def test_a_ply_has_the_surface_of_that_time_in_the_world(
    scene: Scene, shown: Simulation, tmp_path: Path
) -> None:
    options = ExportOptions(time=TIME, backend="cpu", tessellation="own", height_colors="auto")
    for name in ("egg.ply", "again.ply"):
        export_scene(scene, tmp_path / name, options)
    assert (tmp_path / "egg.ply").read_bytes() == (tmp_path / "again.ply").read_bytes()
    found = trimesh.load(tmp_path / "egg.ply", process=False)
    expected = shown.ripples.surface("egg", shown.data)
    heights = heights_of(tmp_path / "egg.ply")
    highest = np.abs(heights).max()
    assert highest > 1e-4
    # the exporter smooths heights by a spline
    assert np.linalg.norm(found.vertices - expected.V, axis=1).max() < 0.3 * highest
    flat = shown.ripples["egg"].to_world(shown.ripples["egg"].atlas.mesh.V, shown.data)
    moved = np.linalg.norm(found.vertices - flat, axis=1)
    np.testing.assert_allclose(moved, np.abs(heights), atol=1e-6)
    np.testing.assert_array_equal(found.visual.vertex_colors[:, :3], colors(heights, highest))


def test_a_glb_has_the_scene_with_y_up(scene: Scene, tmp_path: Path) -> None:
    options = ExportOptions(time=TIME, backend="cpu", tessellation="own")
    for name in ("egg.ply", "egg.glb"):
        export_scene(scene, tmp_path / name, options)
    found = trimesh.load(tmp_path / "egg.glb", process=False)
    assert set(found.geometry) == {"egg", "floor", "stone"}
    x, y, z = trimesh.transform_points(found.geometry["egg"].vertices, found.graph.get("egg")[0]).T
    in_ply = trimesh.load(tmp_path / "egg.ply", process=False).vertices
    np.testing.assert_allclose(np.stack([x, -z, y], axis=1), in_ply, atol=1e-6)
    np.testing.assert_allclose(
        found.geometry["egg"].vertex_attributes["_height"].ravel(), heights_of(tmp_path / "egg.ply")
    )
    stone = found.geometry["stone"].visual.material
    np.testing.assert_array_equal(stone.baseColorFactor, [255, 0, 0, 255])
    assert found.geometry["floor"].visual.material.baseColorTexture.size == (8, 8)


def test_heights_in_a_glb_have_linear_colours_and_no_metal(
    ripples: Ripples, tmp_path: Path
) -> None:
    data = mujoco.MjData(ripples.model)
    mujoco.mj_forward(ripples.model, data)
    ripples["egg"].height = 0.01
    with Exporter(
        ripples.model, ripples, tmp_path / "egg.glb", height_colors=0.02, limit=False
    ) as exporter:
        exporter.write(data)
    ripples.reset()
    egg = trimesh.load(tmp_path / "egg.glb", process=False).geometry["egg"].visual
    assert egg.material.metallicFactor == 0
    half = np.rint(255 * srgb_to_linear(colors([0.01], 0.02)[0] / 255))
    assert np.abs(egg.vertex_attributes["color"][:, :3].astype(int) - half).max() <= 3


def test_a_folder_has_one_mesh_per_frame_and_only_our_meshes_are_replaced(
    scene: Scene, tmp_path: Path
) -> None:
    folder = tmp_path / "egg.meshes"
    options = ExportOptions(fps=60, duration=0.05, backend="cpu", tessellation="own")
    for _ in range(2):
        export_scene(scene, folder, options)
        assert [each.name for each in sorted(folder.iterdir())] == [
            f"egg_{number:05d}.ply" for number in range(3)
        ]
    peaks = [np.abs(heights_of(each)).max() for each in sorted(folder.iterdir())]
    assert peaks[0] == 0 and peaks[2] > 1e-4
    export_scene(scene, tmp_path / "last.ply", options)  # the end, where no time is given
    assert heights_of(tmp_path / "last.ply").size == heights_of(folder / "egg_00000.ply").size
    (folder / "thesis.txt").write_text("mine")
    with pytest.raises(RippleError, match="folder of other things"):
        export_scene(scene, folder, options)
    assert (folder / "thesis.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("egg.csv", {"time": 0.01}, "time is only for .ply, .glb, not for"),
        ("egg.meshes", {"time": 0.01}, "time is only for .ply, .glb, not for"),
        ("egg.usdc", {"height_colors": 0.1}, "height_colors is only for .ply, .glb, .meshes, not"),
    ],
)
def test_options_of_meshes_are_refused_for_other_formats(
    scene: Scene, tmp_path: Path, name: str, options: dict, message: str
) -> None:
    if name.endswith("usdc"):
        pytest.importorskip("pxr")
    with pytest.raises(RippleError, match=message):
        export_scene(scene, tmp_path / name, ExportOptions(**options))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"time": -1.0}, "time must be 0 s or more, got -1.0"),
        ({"height_colors": 0.0}, "height colors must be 'auto', or a number of metres greater"),
        ({"mesh_format": "obj"}, "mesh format must be 'ply' or 'glb', got 'obj'"),
    ],
)
def test_invalid_options_of_meshes_are_refused(options: dict, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        ExportOptions(**options)


def test_foreign_meshes_are_not_replaced(ripples: Ripples, tmp_path: Path) -> None:
    data = mujoco.MjData(ripples.model)
    for name in ("egg.ply", "egg.glb"):
        trimesh.creation.box().export(tmp_path / name)
        before = (tmp_path / name).read_bytes()
        with pytest.raises(RippleError, match="--overwrite"):
            Exporter(ripples.model, ripples, tmp_path / name)
        assert (tmp_path / name).read_bytes() == before
        for overwrite in (True, False):
            with Exporter(ripples.model, ripples, tmp_path / name, overwrite=overwrite) as exporter:
                exporter.write(data)
