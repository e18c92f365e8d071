"""The default scene around a mesh stands upright on the floor, whatever the file's axes and units."""

import mujoco
import numpy as np
import pytest
import trimesh

from ripple_sim.coupling.target_mesh import target_mesh
from ripple_sim.errors import SceneError
from ripple_sim.scene.drop import drop_scene
from ripple_sim.scene.load_scene import check_scene
from ripple_sim.scene.scene import Scene


def vertices(scene: Scene) -> np.ndarray:
    """Of the target in the world; its body is the world's."""
    geom = scene.model.geom("target")
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, geom.quat)
    return target_mesh(scene.model, geom.id).V @ rotation.reshape(3, 3).T + geom.pos


def cone(folder, name: str, turn: list | None = None) -> str:
    """A cone 300 units high and 200 wide, off the origin, in a file; its tip is at its greatest z before a turn."""
    solid = trimesh.creation.cone(radius=100, height=300, sections=16)
    solid.apply_translation([500, -700, 40])
    if turn is not None:
        solid.vertices = solid.vertices @ np.array(turn).T
    solid.export(folder / name)
    return str(folder / name)


Z_TO_Y = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]


@pytest.mark.parametrize(
    ("name", "turn", "up"),
    [("a.stl", None, None), ("a.obj", Z_TO_Y, None), ("a.obj", None, "z"), ("a.stl", Z_TO_Y, "y")],
)
def test_the_tip_of_a_cone_is_a_metre_above_the_floor(tmp_path, name: str, turn: list | None, up: str | None) -> None:
    scene = drop_scene(cone(tmp_path, name, turn), bodies=0, up=up)
    V = vertices(scene)
    np.testing.assert_allclose(V.min(axis=0), [-1 / 3, -1 / 3, 0], atol=1e-4)
    np.testing.assert_allclose(V.max(axis=0), [1 / 3, 1 / 3, 1], atol=1e-4)
    np.testing.assert_allclose(V[V[:, 2] > 0.99], [[0, 0, 1]], atol=1e-4)


def test_the_scene_is_one_that_a_file_could_have_described(tmp_path) -> None:
    scene = drop_scene(cone(tmp_path, "spire.stl"), bodies=5, look="rubber")
    check_scene(scene)
    assert scene.name == "spire"
    assert len(scene.events.drop) == 5
    assert all(drop.time < scene.duration for drop in scene.events.drop)


def test_an_edit_changes_the_model_and_mujocos_refusal_of_it_is_named(tmp_path) -> None:
    path = cone(tmp_path, "a.stl")
    assert (
        drop_scene(path, bodies=0, edit=lambda spec: setattr(spec.option, "timestep", 0.004)).model.opt.timestep
        == 0.004
    )
    with pytest.raises(SceneError, match=r"MuJoCo refuses the mesh '.*a\.stl': "):
        drop_scene(path, bodies=0, edit=lambda spec: spec.worldbody.add_geom(size=[-1, 0, 0]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"bodies": -1}, "number of bodies is -1; valid is 0 to 100"),
        ({"bodies": 101}, "number of bodies is 101"),
        ({"up": "x"}, "up axis is 'x'; valid are 'y' and 'z'"),
        ({"texture": "a.png"}, "has no texture coordinates"),
    ],
)
def test_invalid_options_are_named(tmp_path, options: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        drop_scene(cone(tmp_path, "a.stl"), **options)


def test_waves_on_a_thinner_target_are_lower(tmp_path) -> None:
    density = []
    for thickness in (0.2, 0.1):
        trimesh.creation.box((1.0, 1.0, thickness)).export(tmp_path / "slab.stl")
        density.append(drop_scene(tmp_path / "slab.stl", bodies=0).targets[0].material.density)
    assert density[1] == pytest.approx(2 * density[0], rel=0.01)


TRIANGLES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\n"


@pytest.mark.parametrize("more", ["", "f 2 4 3\n"])
def test_a_sheet_of_one_triangle_or_of_two_lies_down_above_the_floor(tmp_path, more: str) -> None:
    path = tmp_path / "sheet.obj"
    path.write_text(TRIANGLES + more)
    scene = drop_scene(path, bodies=2)
    corners = vertices(scene)[target_mesh(scene.model, scene.model.geom("target").id).F]
    assert len(corners) == 1 + bool(more)
    np.testing.assert_allclose(corners[..., 2], 0.25, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(np.cross(*np.diff(corners, axis=1).swapaxes(0, 1)), axis=1), 1, atol=1e-6)


def test_bodies_drop_on_the_edge_of_an_upright_sheet_that_is_not_seen_from_above(tmp_path) -> None:
    path = tmp_path / "sheet.obj"
    path.write_text(TRIANGLES + "f 2 4 3\n")
    scene = drop_scene(path, bodies=3, up="y")
    places = np.array([drop.position for drop in scene.events.drop])
    np.testing.assert_allclose(np.abs(places[:, :2]), [[0.5, 0]] * 3, atol=1e-6)
