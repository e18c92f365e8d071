"""Scenes that the viewer saves: they load again, with the model, the materials and the camera."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ripple_sim.scene import load_scene
from ripple_sim.simulation import Simulation
from ripple_sim.solver import Material, RippleError
from ripple_sim.viewer import BALLS, Choices, Opened, moved_camera, opened, save_scene

SIZE = 5  # points along an edge of the sheet


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    """An open mesh with an image."""
    along = np.arange(SIZE)
    lines = ["mtllib sheet.mtl", "usemtl paper"]
    points = [(i, j) for i in along for j in along]
    lines += [f"v {i} {j} {0.1 * np.sin(i)}" for i, j in points]
    lines += [f"vt {i / SIZE} {j / SIZE}" for i, j in points]
    for i, j in points:
        if i < SIZE - 1 and j < SIZE - 1:
            a = i * SIZE + j + 1
            b = a + 1
            c = a + SIZE
            d = a + SIZE + 1
            lines += [f"f {a}/{a} {c}/{c} {d}/{d}", f"f {a}/{a} {d}/{d} {b}/{b}"]
    (tmp_path / "sheet.obj").write_text("\n".join(lines))
    (tmp_path / "sheet.mtl").write_text("newmtl paper\nmap_Kd sheet.png\n")
    pixels = np.random.default_rng(0).integers(0, 255, (8, 16, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(tmp_path / "sheet.png")
    return tmp_path / "sheet.obj"


def test_a_mesh_gets_an_mjcf_with_its_image_and_its_events(sheet: Path, tmp_path: Path) -> None:
    origin = opened(sheet, bodies=2)
    scene = origin.scene
    path = tmp_path / "saved.toml"
    save_scene(origin, scene.targets, scene.camera, path)
    sheet.unlink()
    saved = load_scene(path)
    assert saved.targets == scene.targets
    assert saved.camera == scene.camera
    assert saved.events == scene.events
    assert saved.model.nbody == scene.model.nbody - BALLS
    np.testing.assert_array_equal(saved.model.tex_data, scene.model.tex_data)
    np.testing.assert_array_equal(saved.model.mesh_facetexcoord, scene.model.mesh_facetexcoord)
    for field in ("mesh_vert", "mesh_texcoord"):
        kept = getattr(saved.model, field)
        own = getattr(scene.model, field)
        np.testing.assert_allclose(kept, own, atol=1e-6)  # written as float32


def test_chosen_materials_are_those_of_the_saved_scene(ball: Opened, tmp_path: Path) -> None:
    """A preset, factors of a preset, and factors of the scene's own material."""
    ripples = Simulation(ball.scene, resolution=20).ripples
    (name,) = ripples
    own = ripples[name].material
    choices = Choices(ripples)

    def saved() -> Material:
        entries = [choices.chosen(entry) for entry in ball.scene.targets]
        save_scene(ball, entries, ball.scene.camera, tmp_path / "saved.toml")
        return load_scene(tmp_path / "saved.toml").targets[0].material.material()

    choices.choose_preset([name], "gelatine-5")
    np.testing.assert_equal(vars(saved()), vars(Material.preset("gelatine-5")))
    np.testing.assert_equal(vars(ripples[name].material), vars(Material.preset("gelatine-5")))
    choices.choose_factors({"speed": 2.0, "damping": 0.5})
    assert saved().speed == 2 * Material.preset("gelatine-5").speed
    assert saved().density == Material.preset("gelatine-5").density
    choices.choose_preset([name], "")
    assert saved().speed == 2 * own.speed
    assert saved().damping == 0.5 * own.damping
    choices.choose_factors({})
    assert choices.is_empty
    np.testing.assert_equal(vars(ripples[name].material), vars(own))


def test_factors_of_a_material_that_varies_are_refused(ball: Opened) -> None:
    ripples = Simulation(ball.scene, resolution=8).ripples
    (name,) = ripples
    areas = ripples[name].atlas.areas
    ripples.change_material(name, speed=np.linspace(0.5, 1.0, areas.size).reshape(areas.shape))
    choices = Choices(ripples)
    choices.choose_factors({"damping": 2.0})
    with pytest.raises(ValueError, match="varies over the surface"):
        choices.chosen(ball.scene.targets[0])


def test_a_camera_that_was_moved_is_free_and_keeps_its_lens(ball: Opened) -> None:
    place = {"lookat": [0, 0, 1], "distance": 2, "azimuth": 30, "elevation": -10, "fovy": 40}
    camera = moved_camera(ball.scene, place)
    assert camera.azimuth == 30
    assert camera.orbit == 0
    assert camera.key == []
    assert camera.exposures == ball.scene.camera.exposures
    with pytest.raises(RippleError, match="distance"):
        moved_camera(ball.scene, {**place, "distance": "far"})
