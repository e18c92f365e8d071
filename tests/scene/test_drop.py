"""The default scene of a mesh: upright on the floor, with the mesh's own colours."""

import dataclasses
from pathlib import Path

import msgspec
import mujoco
import numpy as np
import pytest
import trimesh
from PIL import Image

from ripple_sim.capture import FrameSource, snapshots
from ripple_sim.coupling.target_mesh import target_mesh
from ripple_sim.errors import SceneError
from ripple_sim.scene import (
    UP_AXES,
    Scene,
    check_scene,
    drop_scene,
    paint_target,
    usual_up,
)
from ripple_sim.scene.events import Events, Script
from ripple_sim.scenes.shapes import peanut
from ripple_sim.simulation import Simulation
from ripple_sim.solver import Mesh, load_mesh


def vertices(scene: Scene) -> np.ndarray:
    """Of the target in the world; its body is the world's."""
    geom = scene.model.geom("target")
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, geom.quat)
    return target_mesh(scene.model, geom.id).V @ rotation.reshape(3, 3).T + geom.pos


def cone(folder, name: str, turn: list | None = None) -> str:
    """A cone 300 units high and 200 wide, off the origin; its tip is its greatest z."""
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
def test_the_tip_of_a_cone_is_a_metre_above_the_floor(
    tmp_path, name: str, turn: list | None, up: str | None
) -> None:
    scene = drop_scene(cone(tmp_path, name, turn), bodies=0, up=up)
    V = vertices(scene)
    np.testing.assert_allclose(V.min(axis=0), [-1 / 3, -1 / 3, 0], atol=1e-4)
    np.testing.assert_allclose(V.max(axis=0), [1 / 3, 1 / 3, 1], atol=1e-4)
    np.testing.assert_allclose(V[V[:, 2] > 0.99], [[0, 0, 1]], atol=1e-4)


def test_the_default_scene_passes_the_checks_of_scene_files(tmp_path) -> None:
    scene = drop_scene(cone(tmp_path, "spire.stl"), bodies=5, look="rubber")
    check_scene(scene)
    assert scene.name == "spire"
    assert len(scene.events.drop) == 5
    assert all(drop.time < scene.duration for drop in scene.events.drop)


def test_an_edit_changes_the_model_and_mujocos_refusal_of_it_is_named(tmp_path) -> None:
    path = cone(tmp_path, "a.stl")
    slower = drop_scene(path, bodies=0, edit=lambda spec: setattr(spec.option, "timestep", 0.004))
    assert slower.model.opt.timestep == 0.004
    with pytest.raises(SceneError, match=r"MuJoCo refuses the mesh '.*a\.stl': "):
        drop_scene(path, bodies=0, edit=lambda spec: spec.worldbody.add_geom(size=[-1, 0, 0]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"bodies": -1}, "number of bodies must be 0 to 100, got -1"),
        ({"bodies": 101}, "number of bodies must be .*, got 101"),
        ({"up": "x"}, "up axis must be 'y' or 'z', got 'x'"),
        ({"view": "side"}, "view must be front, left, back, right, top, or an .* got 'side'"),
        ({"view": np.nan}, "view must be front, .* got nan"),
        ({"elevation": 91}, "elevation must be a number from -90, .*, got 91"),
        ({"shapes": ["egg"]}, "shape must be ball, sphere, box, .* got 'egg'"),
        ({"shapes": []}, "no shape is given"),
        ({"look": "gold"}, "look must be .*rubber.*gold"),
        ({"color": (2, 0, 0)}, "three numbers from 0 to 1"),
    ],
)
def test_invalid_options_are_named(tmp_path, options: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        drop_scene(cone(tmp_path, "a.stl"), **options)


def test_waves_on_a_thinner_target_are_lower(tmp_path) -> None:
    density = []
    for thickness in (0.07, 0.05):
        trimesh.creation.box((1.0, 1.0, thickness)).export(tmp_path / "slab.stl")
        density.append(drop_scene(tmp_path / "slab.stl", bodies=0).targets[0].material.density)
    assert density[1] == pytest.approx(1.4 * density[0], rel=0.01)


TRIANGLES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\n"


@pytest.mark.parametrize("more", ["", "f 2 4 3\n"])
def test_a_sheet_of_one_triangle_or_of_two_lies_down_above_the_floor(tmp_path, more: str) -> None:
    path = tmp_path / "sheet.obj"
    path.write_text(TRIANGLES + more)
    scene = drop_scene(path, bodies=2)
    corners = vertices(scene)[target_mesh(scene.model, scene.model.geom("target").id).F]
    assert len(corners) == 1 + bool(more)
    np.testing.assert_allclose(corners[..., 2], 0.25, atol=1e-6)
    np.testing.assert_allclose(
        np.linalg.norm(np.cross(*np.diff(corners, axis=1).swapaxes(0, 1)), axis=1), 1, atol=1e-6
    )


def surface(name: str) -> trimesh.Trimesh:
    """A surface 1.0 long, 0.8 wide and 0.3 high or less, along x, y and z."""
    if name == "pipe":
        pipe = trimesh.creation.cylinder(0.15, 1.0, sections=12)
        pipe.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
        sides = np.abs(pipe.face_normals[:, 0]) < 0.5
        return trimesh.Trimesh(pipe.vertices, pipe.faces[sides])
    if name == "slab":
        return trimesh.creation.box((1.0, 0.8, 0.1))
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 9), np.linspace(-0.4, 0.4, 9))
    V = np.stack([x, y, 0.14 * np.sin(6 * x) * np.cos(5 * y)], axis=-1).reshape(-1, 3)
    first = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    F = np.concatenate([first[:, None] + [0, 1, 10], first[:, None] + [0, 10, 9]])
    cloth = trimesh.Trimesh(V, F)
    if name == "two cloths":
        return trimesh.util.concatenate([cloth, cloth.copy().apply_translation([0, 0, 1e-3])])
    return cloth


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_an_open_sheet_lies_down_whatever_its_axis_and_a_note_says_how_to_stand_it(
    tmp_path, turn: int
) -> None:
    cloth = surface("cloth")
    cloth.vertices = np.roll(cloth.vertices, turn, axis=1)
    cloth.export(tmp_path / "cloth.obj")
    scene = drop_scene(tmp_path / "cloth.obj", bodies=0)
    assert np.ptp(vertices(scene), axis=0)[2] < 0.3
    # files other than STL stand on their y axis, which is the thin one after two turns
    lies_as_usual = turn == 2
    assert [note for note in scene.notes if "lies down" in note and "--up y" in note] == (
        [] if lies_as_usual else [scene.notes[-1]]
    )
    if not lies_as_usual:
        standing = drop_scene(tmp_path / "cloth.obj", bodies=0, up="y")
        assert np.ptp(vertices(standing), axis=0)[2] > 0.75
        assert not any("lies down" in note for note in standing.notes)


@pytest.mark.parametrize("name", ["pipe", "slab", "two cloths"])
def test_closed_meshes_meshes_in_parts_and_round_meshes_do_not_lie_down(
    tmp_path, name: str
) -> None:
    surface(name).export(tmp_path / "a.obj")
    scene = drop_scene(tmp_path / "a.obj", bodies=0)
    assert not any("lies down" in note for note in scene.notes)


def boxes(*bounds: list) -> trimesh.Trimesh:
    return trimesh.util.concatenate([trimesh.creation.box(bounds=each) for each in bounds])


def middle_azimuth(scene: Scene) -> float:
    """Of the camera, half-way of its orbit [degrees]."""
    return scene.camera.azimuth + scene.camera.orbit * scene.duration / 2


def test_the_camera_sees_letters_from_the_front_upright_or_lying(tmp_path) -> None:
    letter = boxes([[0, 0, 0], [2, 10, 3]], [[0, 8, 0], [6, 10, 3]], [[0, 4, 0], [5, 6, 3]])
    letter.export(tmp_path / "F.obj")  # upright, its front towards +z
    letter.export(tmp_path / "F.stl")  # lying, its top towards +y
    for name in ("F.obj", "F.stl"):
        scene = drop_scene(tmp_path / name, bodies=0)
        assert 45 < middle_azimuth(scene) < 135  # along +y, give or take


@pytest.mark.parametrize("side", [0, 1])
def test_the_camera_sees_where_bodies_land_beside_a_wall(tmp_path, side: int) -> None:
    wall = [[92 * side, 0, 0], [92 * side + 8, 60, 80]]
    boxes([[0, 0, 0], [100, 60, 8]], wall).export(tmp_path / "bracket.stl")
    scene = drop_scene(tmp_path / "bracket.stl", bodies=0)
    forward = np.cos(np.radians(middle_azimuth(scene)))
    assert forward * (2 * side - 1) > 0.3  # against the wall


def test_the_camera_sees_a_round_head_even_at_the_back(tmp_path) -> None:
    trunk = trimesh.creation.icosphere(2, 0.25).apply_scale([1, 1.6, 0.8])
    head = trimesh.creation.icosphere(2, 0.13).apply_translation([0, 0.45, 0.3])
    trimesh.util.concatenate([trunk, head]).export(tmp_path / "animal.stl")
    scene = drop_scene(tmp_path / "animal.stl", bodies=0)
    assert np.sin(np.radians(middle_azimuth(scene))) < 0


def test_gltf_files_state_their_up_axis_and_their_front(tmp_path) -> None:
    """A flag on a pole falls over on y, and the head of an animal is at its back."""
    pole = trimesh.creation.box((0.2, 1, 0.2))
    flag = trimesh.creation.box((1, 0.2, 0.2)).apply_translation([0.5, 0.5, 0])
    heights = []
    for name in ("flag.obj", "flag.glb"):
        trimesh.util.concatenate([pole, flag]).export(tmp_path / name)
        heights.append(np.ptp(vertices(drop_scene(tmp_path / name, bodies=0))[:, 2]))
    assert heights[0] < 0.2 and heights[1] > 0.9
    trunk = trimesh.creation.icosphere(2, 0.25).apply_scale([1, 1.6, 0.8])
    head = trimesh.creation.icosphere(2, 0.13).apply_translation([0, 0.45, -0.3])
    animal = trimesh.util.concatenate([trunk, head])
    fronts = []
    for name in ("animal.obj", "animal.glb"):
        animal.export(tmp_path / name)
        fronts.append(np.sin(np.radians(middle_azimuth(drop_scene(tmp_path / name, bodies=0)))) > 0)
    assert fronts == [False, True]


def test_view_elevation_color_and_shapes_are_used(tmp_path) -> None:
    path = cone(tmp_path, "a.stl")
    for view, azimuth in (("front", 90), ("left", 0), ("back", 270), ("right", 180), (33, 33)):
        scene = drop_scene(path, bodies=0, view=view, elevation=-12)
        assert middle_azimuth(scene) == pytest.approx(azimuth)
        assert scene.camera.elevation == -12
    top = drop_scene(path, bodies=3, view="top", color=(0.1, 0.2, 0.3), shapes=["ball", "box"])
    assert (top.camera.elevation, top.camera.orbit) == (-90, 0)
    assert top.targets[0].color == (0.1, 0.2, 0.3)
    kinds = [int(top.model.geom(f"body_{i}").type[0]) for i in range(3)]
    sphere, box = (int(mujoco.mjtGeom.mjGEOM_SPHERE), int(mujoco.mjtGeom.mjGEOM_BOX))
    assert kinds == [sphere, box, sphere]


def test_bodies_drop_on_the_edge_of_an_upright_sheet_that_is_not_seen_from_above(tmp_path) -> None:
    path = tmp_path / "sheet.obj"
    path.write_text(TRIANGLES + "f 2 4 3\n")
    scene = drop_scene(path, bodies=3, up="y")
    places = np.array([drop.position for drop in scene.events.drop])
    np.testing.assert_allclose(np.abs(places[:, :2]), [[0.5, 0]] * 3, atol=1e-6)


RED = (230, 20, 20)
BLUE = (20, 20, 230)


def half_and_half(path: Path) -> Path:
    """A picture that is red in its upper half and blue in its lower one."""
    picture = np.full((16, 16, 3), BLUE, dtype=np.uint8)
    picture[:8] = RED
    Image.fromarray(picture).save(path)
    return path


def textured_obj(path: Path, head: str = "", before_faces: str = "") -> Path:
    """A peanut whose v is its height from 0 to 1; y is up, as is usual in OBJ files."""
    V, F = peanut()
    lines = [head, *(f"v {x} {y} {z}" for x, y, z in V)]
    lines += [f"vt 0.5 {v}" for v in (V[:, 1] - V[:, 1].min()) / np.ptp(V[:, 1])]
    lines += [before_faces, *("f " + " ".join(f"{i + 1}/{i + 1}" for i in face) for face in F)]
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("how", ["named", "asked for", "p.ply", "p.glb", "p.obj"])
def test_the_target_is_drawn_with_its_image_or_its_vertex_colours(opengl, tmp_path, how):
    """Red above and blue below, in the film and in the model that MuJoCo would draw."""
    if how.startswith("p."):
        V, F = peanut()
        colors = np.where(V[:, 1:2] > np.median(V[:, 1]), RED, BLUE).astype(np.uint8)
        trimesh.Trimesh(V, F, vertex_colors=colors, process=False).export(tmp_path / how)
        scene = drop_scene(tmp_path / how, bodies=0, up="y")
    else:
        mesh = textured_obj(tmp_path / "p.obj")
        half_and_half(tmp_path / ("p_texture.png" if how == "named" else "paint.png"))
        scene = drop_scene(
            mesh, bodies=0, up="y", texture=None if how == "named" else tmp_path / "paint.png"
        )
    model = scene.model
    assert model.mat_texid[model.geom("target").matid[0], mujoco.mjtTextureRole.mjTEXROLE_RGB] == 0
    simulation = Simulation(scene, fps=10, resolution=16, backend="cpu")
    source = FrameSource(simulation, width=96, height=72)
    frame = source.render(next(iter(snapshots(simulation, 1)))).astype(int)
    redder = frame[..., 0] - frame[..., 2]
    red, blue = (np.nonzero(each)[0] for each in (redder > 60, redder < -60))  # rows
    assert min(len(red), len(blue)) > 100
    assert np.median(red) < np.median(blue)


PIXELS = np.random.default_rng(0).integers(0, 256, (3, 5, 3), dtype=np.uint8)


def textured_cube(folder) -> tuple[mujoco.MjSpec, Mesh]:
    """A cube whose texture coordinates are its x and z, and a model with it as its target."""
    V = trimesh.creation.box(extents=(1, 1, 1)).vertices + 0.5
    F = trimesh.creation.box().faces
    lines = [f"v {x} {y} {z}" for x, y, z in V] + [f"vt {x} {z}" for x, _, z in V]
    lines += ["f " + " ".join(f"{i + 1}/{i + 1}" for i in face) for face in F]
    (folder / "cube.obj").write_text("\n".join(lines))
    mesh = load_mesh(folder / "cube.obj")
    spec = mujoco.MjSpec()
    spec.add_mesh(name="target", uservert=mesh.V.ravel(), userface=mesh.F.ravel())
    spec.worldbody.add_geom(name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="target")
    return spec, mesh


def test_a_given_texture_reaches_the_model_bit_for_bit_and_the_right_way_up(
    tmp_path,
) -> None:
    """MuJoCo counts v from the upper edge of the image.

    Another image beside the mesh is not taken.
    """
    spec, mesh = textured_cube(tmp_path)
    Image.fromarray(PIXELS).save(tmp_path / "image.png")
    Image.fromarray(255 - PIXELS).save(tmp_path / "cube_texture.png")
    paint_target(spec, mesh, tmp_path / "cube.obj", tmp_path / "image.png")
    model = spec.compile()
    assert (model.tex_height[0], model.tex_width[0], model.tex_nchannel[0]) == PIXELS.shape
    np.testing.assert_array_equal(model.tex_data.reshape(PIXELS.shape), PIXELS)
    material = model.geom("target").matid[0]
    assert (
        model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB] == model.texture("target").id
    )
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.mesh_quat[0])
    corners = model.mesh_texcoord[model.mesh_facetexcoord]
    places = (model.mesh_vert @ rotation.reshape(3, 3).T + model.mesh_pos[0])[model.mesh_face]
    np.testing.assert_allclose(
        corners, np.stack([places[..., 0], 1 - places[..., 2]], axis=-1), atol=1e-6
    )


def test_without_an_image_or_without_coordinates_the_model_stays_plain(tmp_path) -> None:
    spec, mesh = textured_cube(tmp_path)
    paint_target(spec, mesh, tmp_path / "cube.obj", None)
    assert spec.compile().ntex == 0
    bare = Mesh.from_arrays(mesh.V, mesh.F)
    Image.fromarray(PIXELS).save(tmp_path / "cube_texture.png")
    paint_target(spec, bare, tmp_path / "cube.obj", None)
    assert spec.compile().ntex == 0
    with pytest.raises(
        SceneError,
        match=r"cannot be shown on '.*cube.obj', which has no texture coordinates: choose",
    ):
        paint_target(spec, bare, tmp_path / "cube.obj", tmp_path / "cube_texture.png")


@pytest.mark.parametrize(
    ("name", "up"),
    [
        ("a.stl", "z"),
        ("A.STL", "z"),
        ("a.stl.obj", "y"),
        ("a.glb", "y"),
        ("stl", "y"),
        ("b.stl/a.ply", "y"),
    ],
)
def test_stl_files_stand_on_z_and_other_files_on_y(name: str, up: str) -> None:
    assert usual_up(name) == usual_up(Path("there") / name) == up
    assert up in UP_AXES


def _bumpy() -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(3, 0.5)
    ball.vertices *= 1 + 0.15 * np.sin(9 * ball.vertices).prod(axis=1, keepdims=True)
    return ball


def _open(solid: trimesh.Trimesh, keep: float) -> trimesh.Trimesh:
    """The part of a solid's surface whose triangles are no higher than a height."""
    return trimesh.Trimesh(solid.vertices, solid.faces[solid.triangles_center[:, 2] < keep])


STRANGERS = {
    "ball": lambda: trimesh.creation.icosphere(2, 0.5),
    "torus": lambda: trimesh.creation.torus(0.35, 0.15, 24, 12),
    "box": lambda: trimesh.creation.box((0.6, 0.8, 1.0)),
    "sheet": lambda: _open(trimesh.creation.box((1, 1, 0.5)).subdivide().subdivide(), -0.24),
    "bowl": lambda: _open(trimesh.creation.icosphere(2, 0.5), 0.1),
    "two": lambda: trimesh.util.concatenate(
        [trimesh.creation.icosphere(2, 0.25).apply_translation([x, 0, 0]) for x in (-0.3, 0.3)]
    ),
    "plate": lambda: trimesh.creation.box((1.0, 0.6, 0.05)),
    "bumpy": _bumpy,
}


@pytest.fixture(scope="module", params=STRANGERS)
def stranger(request, tmp_path_factory) -> Scene:
    path = tmp_path_factory.mktemp("stranger") / "mesh.stl"
    STRANGERS[request.param]().export(path)
    return drop_scene(path, bodies=6)


def test_four_of_six_bodies_hit_a_mesh_of_any_shape_within_three_seconds(stranger) -> None:
    model = stranger.model
    data = mujoco.MjData(stranger.model)
    hits = set()
    script = Script(model, stranger.events, ["target"])
    target = model.geom("target").id
    while data.time < 3:
        script.apply(data, {})
        mujoco.mj_step(model, data)
        # the target is a geom, or its flex
        pairs = [
            np.where(np.array(contact.flex) >= 0, target, contact.geom) for contact in data.contact
        ]
        hits |= {int(pair[pair != target][0]) for pair in pairs if target in pair}
    assert len(hits - {model.geom("floor").id}) >= 4


def test_a_mesh_of_any_shape_fills_the_picture_and_every_hit_makes_visible_rings(
    opengl, stranger
) -> None:
    """Seen is what changes 30 pixels of 640 x 360 by 10 of 255 about a hit, 0.2 s after it."""
    first, second, *_ = stranger.events.drop
    events = Events(drop=[first, msgspec.structs.replace(second, time=0.35)])
    simulation = Simulation(
        dataclasses.replace(stranger, events=events), fps=10, resolution=24, backend="cpu"
    )
    source = FrameSource(simulation, width=320, height=180)
    hits: dict[str, tuple[int, np.ndarray]] = {}
    for snapshot in snapshots(simulation, 12):
        for impulse in snapshot.impulses:
            hits.setdefault(impulse.other, (snapshot.number, impulse.point))
        due = [point for number, point in hits.values() if snapshot.number == number + 2]
        if snapshot.number and not due:
            continue
        flat = dataclasses.replace(
            snapshot, height_maps={"target": 0 * snapshot.height_maps["target"]}
        )
        sighting = source.sighting(flat)
        target = sighting.image.target >= 0
        if not snapshot.number:
            rows, columns = (np.ptp(where) for where in np.nonzero(target))
            assert 0.55 < rows / 180 < 0.7
            assert columns / 320 < 0.85
            continue
        change = np.abs(source.render(snapshot).astype(int) - source.render(flat)).max(axis=-1)
        for point in due:
            near = np.linalg.norm(sighting.positions_seen - point, axis=-1) < 0.25
            assert (change[near & target] >= 10).sum() >= 30 / 4
        assert np.abs(snapshot.heights["target"]).max() < 0.12, "it would crumple"
    assert {"body_0", "body_1"} <= set(hits)
