"""The renderer against geometry that is known in closed form. Needs an OpenGL context; software will do."""

import mujoco
import numpy as np
import pytest
from sphere_height_maps import N, constant_height_map, height_map_of, linear_height_map

from ripple_sim.render import LOOKS, Camera, Renderer, Surface
from ripple_sim.render.projection import perspective, view_matrix
from ripple_sim.render.surfaces.tessellation import tessellate
from ripple_sim.render.visuals import primitives as meshes
from ripple_sim.render.visuals.corners import corner_normals, triangle_normals
from ripple_sim.solver import RippleError
from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import GLContext, shared_context

SIZE = (240, 180)
FRONT = Camera(lookat=(0.0, 0.0, 0.0), distance=4.0, azimuth=90.0, elevation=0.0, fovy=40.0)

LONE_BALL = '<mujoco><worldbody><geom name="target" type="sphere" size="1"/></worldbody></mujoco>'
SCENE = """
<mujoco>
  <asset>
    <texture name="tiles" type="2d" builtin="checker" width="16" height="16" rgb1=".8 .8 .8" rgb2=".6 .6 .6"/>
    <material name="floor" texture="tiles" texrepeat="2 2" texuniform="true"/>
    <mesh name="tetrahedron" vertex="0 0 0  .5 0 0  0 .5 0  0 0 .5"/>
  </asset>
  <worldbody>
    <camera name="side" pos="0 -5 1" xyaxes="1 0 0 0 .2 1"/>
    <geom type="plane" size="0 0 .1" material="floor" pos="0 0 -1"/>
    <geom type="plane" size=".4 .4 .1" pos="2 2 -.5" euler="30 0 0"/>
    <geom name="target" type="sphere" size="1"/>
    <body pos="1.5 0 0"><geom type="box" size=".2 .3 .1"/></body>
    <body pos="-1.5 0 0"><geom type="capsule" size=".2 .3" rgba="1 0 0 .5"/></body>
    <body pos="0 -1.5 -.5"><geom type="cylinder" size=".2 .3"/></body>
    <body pos="1 -1.5 -.5"><geom type="ellipsoid" size=".2 .3 .1"/></body>
    <body pos="-1 -1.5 -.5"><geom type="sphere" size=".2"/></body>
    <body pos="-1 -2 -.5"><geom type="mesh" mesh="tetrahedron"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def gl() -> GLContext:
    try:
        return shared_context()
    except GLError as error:
        pytest.skip(f"no OpenGL context: {error}")


def ball_surface(radius: float = 1.0, look: str = "clay") -> Surface:
    ball = meshes.ball(16)
    return Surface(radius * ball.shell, ball.faces, ball.shell, N, look)


def make(gl, xml=LONE_BALL, surface=None, size=SIZE, **options):
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    target = model.geom("target").id
    renderer = Renderer(gl, model, {target: surface or ball_surface()}, size=size, **options)
    return renderer, data, target


def silhouette(gl, surface, height_map) -> np.ndarray:
    """Pixels that a target covers: those that differ from a frame from which the target is far away."""
    renderer, data, target = make(gl, surface=surface)
    frame = renderer.render(data, {target: height_map}, FRONT).astype(int)
    data.geom_xpos[target] = [0.0, -50.0, 0.0]
    empty = renderer.render(data, {}, FRONT).astype(int)
    return np.abs(frame - empty).max(axis=2) > 4


def test_frame_has_the_asked_size_and_shows_every_kind_of_geom(gl):
    renderer, data, target = make(gl, SCENE)
    frame = renderer.render(data, {target: constant_height_map(0.0)}, Camera((0, 0, 0), 6.0, 90.0, -20.0))
    assert frame.shape == (SIZE[1], SIZE[0], 3)
    assert frame.dtype == np.uint8
    assert frame.std() > 10


def test_same_input_gives_the_same_frame(gl):
    camera = Camera((0, 0, 0), 6.0, 70.0, -20.0)
    height_map = linear_height_map(np.array([0.05, 0.02, -0.03]))
    frames = []
    for _ in range(2):
        renderer, data, target = make(gl, SCENE)
        frames += [renderer.render(data, {target: height_map}, camera) for _ in range(2)]
    for frame in frames[1:]:
        np.testing.assert_array_equal(frame, frames[0])


def test_a_frame_is_not_overwritten_by_the_next(gl):
    renderer, data, target = make(gl)
    first = renderer.render(data, {}, FRONT)
    kept = first.copy()
    renderer.render(data, {target: constant_height_map(0.3)}, FRONT)
    np.testing.assert_array_equal(first, kept)


def test_constant_height_looks_like_a_larger_sphere(gl):
    raised = silhouette(gl, ball_surface(1.0), constant_height_map(0.25))
    larger = silhouette(gl, ball_surface(1.25), constant_height_map(0.0))
    plain = silhouette(gl, ball_surface(1.0), constant_height_map(0.0))
    assert (raised != larger).mean() < 1e-3
    # and both as large as perspective says: the cone that touches a ball of radius r at distance D
    for pixels, radius in ((raised, 1.25), (plain, 1.0)):
        tangent = radius / np.sqrt(FRONT.distance**2 - radius**2)
        expected = np.pi * (tangent / np.tan(np.radians(20)) * SIZE[1] / 2) ** 2
        assert pixels.sum() == pytest.approx(expected, rel=0.02)


def test_constant_height_shades_as_flat(gl):
    """With no gradient the shading normal stays the surface's, whatever the height."""
    renderer, data, target = make(gl)
    flat = renderer.render(data, {target: constant_height_map(0.0)}, FRONT).astype(int)
    raised = renderer.render(data, {target: constant_height_map(0.002)}, FRONT).astype(int)
    inner = np.s_[50:130, 80:160]
    assert flat[inner].std() > 5
    assert np.abs(flat[inner] - raised[inner]).max() <= 3


def test_a_slope_that_faces_the_lamp_is_brighter(gl):
    """The key light stands on the left. A height that grows to the right turns the surface towards it."""
    renderer, data, target = make(gl)
    slope = np.array([0.5, 0.0, 0.0])
    tilted = height_map_of(lambda d: np.zeros(d.shape[:3]), lambda d: slope - (d @ slope)[..., None] * d)
    middle = np.s_[80:100, 110:130]
    flat, lit = (renderer.render(data, {target: r}, FRONT)[middle].mean() for r in (constant_height_map(0.0), tilted))
    assert lit > flat + 20


@pytest.mark.parametrize("direction", [(1, 1, 0), (1, 0, 1), (0, 1, -1), (1, 1, 1), (-1, 1, -1), (-1, -1, 1)], ids=str)
def test_ripples_run_on_across_cube_edges_and_corners(gl, direction):
    """Close up, neighbouring pixels differ no more at an edge or a corner of the cube than in a face's middle."""
    slope = np.array([0.11, -0.07, 0.05])
    height_map = linear_height_map(slope)
    renderer, data, target = make(gl, size=(160, 160), samples=0)

    def steps(d) -> float:
        d = np.array(d, dtype=float) / np.linalg.norm(d)
        azimuth, elevation = np.degrees(np.arctan2(-d[1], -d[0])), np.degrees(np.arcsin(-d[2]))
        camera = Camera(tuple(d), 0.8, azimuth, elevation, 30.0)
        frame = renderer.render(data, {target: height_map}, camera).astype(int)
        # second differences: a smooth gradient has none, a kink or a crack has
        bends = [np.abs(np.diff(frame, n=2, axis=axis)).max() for axis in (0, 1)]
        return max(bends)

    middle = max(
        steps(np.array(direction) * m) for m in ((1, 0, 0), (0, 1, 0), (0, 0, 1)) if np.any(direction * np.array(m))
    )
    assert steps(direction) <= middle + 2


def test_camera_follows_mujocos_convention():
    """At azimuth 90 and elevation 0 the camera looks along +y: +x is right, +z is up."""
    pose = Camera((0.5, 1.0, 2.0), 3.0, 90.0, 0.0).pose()
    np.testing.assert_allclose(pose.position, [0.5, -2.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(pose.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(pose.focus, [0.5, 1.0, 2.0], atol=1e-12)
    clip = perspective(45.0, 2.0, 0.1, 100.0) @ view_matrix(pose)
    edge = np.tan(np.radians(22.5)) * 3.0
    point = clip @ [0.5 + 2 * edge, 1.0, 2.0 + edge, 1.0]
    np.testing.assert_allclose(point[:2] / point[3], [1.0, 1.0], atol=1e-12)


def test_camera_agrees_with_mujocos_own():
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    free = mujoco.MjvCamera()
    free.lookat[:], free.distance, free.azimuth, free.elevation = (0.3, -0.2, 0.1), 2.5, 37.0, -28.0
    scene = mujoco.MjvScene(model, maxgeom=50)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, free, mujoco.mjtCatBit.mjCAT_ALL, scene)
    eyes = [np.array(eye.pos, dtype=float) for eye in scene.camera]
    pose = Camera((0.3, -0.2, 0.1), 2.5, 37.0, -28.0).pose()
    np.testing.assert_allclose(pose.position, np.mean(eyes, axis=0), atol=1e-6)
    np.testing.assert_allclose(-pose.rotation[:, 2], scene.camera[0].forward, atol=1e-6)
    np.testing.assert_allclose(pose.rotation[:, 1], scene.camera[0].up, atol=1e-6)


def test_named_camera_and_the_error_for_an_unknown_one():
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pose = Camera.from_mjcf(model, data, "side").pose()
    np.testing.assert_allclose(pose.position, [0, -5, 1])
    assert -pose.rotation[1, 2] > 0.9
    with pytest.raises(RippleError, match=r"'sid'.*'side'"):
        Camera.from_mjcf(model, data, "sid")


@pytest.mark.parametrize("broken", [{"distance": 0.0}, {"fovy": 180.0}, {"azimuth": np.nan}])
def test_impossible_cameras_are_refused(broken):
    with pytest.raises(RippleError, match="camera"):
        Camera(**{"lookat": (0, 0, 0), "distance": 1.0, "azimuth": 0.0, "elevation": 0.0} | broken)


def ellipsoid_area(a: float, b: float, c: float) -> float:
    theta, phi = np.meshgrid((np.arange(400) + 0.5) * np.pi / 400, (np.arange(400) + 0.5) * np.pi / 200)
    x, y, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
    stretch = np.sqrt((b * c * x) ** 2 + (a * c * y) ** 2 + (a * b * z) ** 2)
    return float((stretch * np.sin(theta)).sum() * np.pi / 400 * np.pi / 200)


@pytest.mark.parametrize(
    ("shape", "core", "shell", "area"),
    [
        (meshes.ball(14), [0, 0, 0], [0.5, 0.5, 0.5], np.pi),
        (meshes.ball(14), [0, 0, 0], [0.5, 0.3, 0.2], ellipsoid_area(0.5, 0.3, 0.2)),
        (meshes.capsule(40, 9), [0, 0, 0.4], [0.3, 0.3, 0.3], 4 * np.pi * 0.09 + 2 * np.pi * 0.3 * 0.8),
        (meshes.cylinder(56, 3), [0.299, 0.299, 0.399], [0.001] * 3, 2 * np.pi * 0.09 + 2 * np.pi * 0.3 * 0.8),
        (meshes.box(3), [0.199, 0.299, 0.399], [0.001] * 3, 8 * (0.2 * 0.3 + 0.3 * 0.4 + 0.4 * 0.2)),
    ],
    ids=["sphere", "ellipsoid", "capsule", "cylinder", "box"],
)
def test_primitives_are_closed_face_outwards_and_have_their_area(shape, core, shell, area):
    V, F = shape.positions(np.array(core), np.array(shell)), shape.faces
    edges = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    directed, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() == 1
    np.testing.assert_array_equal(directed, np.unique(edges[:, ::-1], axis=0))
    cross = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    centre = V[F].mean(axis=1)
    assert np.einsum("ij,ij->i", cross, centre).min() > -1e-15
    # the vertices' own normals lean to the outside of their triangles
    normals = shape.normals / np.array(shell)
    assert np.einsum("ij,ij->i", cross, normals[F].sum(axis=1)).min() > -1e-15
    assert np.linalg.norm(cross, axis=1).sum() / 2 == pytest.approx(area, rel=0.01)


def test_normals_are_smooth_below_the_crease_angle_and_sharp_above():
    cube = meshes.box(1)
    V, F = cube.positions(np.ones(3), np.full(3, 1e-9)), cube.faces
    big = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) > 1.0
    welded, index = np.unique(np.round(V, 6), axis=0, return_inverse=True)
    F = index.ravel()[F[big]]
    sharp = corner_normals(welded, F, crease=45.0)
    np.testing.assert_allclose(np.abs(sharp).max(axis=2), 1.0, atol=1e-12)
    smooth = corner_normals(welded, F, crease=180.0)
    np.testing.assert_allclose(smooth, welded[F] / np.sqrt(3), atol=1e-12)


def directed_edges(F) -> np.ndarray:
    return np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])


def refine(V, F, normals, same=None, **limits):
    attributes = np.concatenate([V, normals, 2 * V], axis=1)
    same = np.arange(len(V)) if same is None else same
    F, finer, _ = tessellate(F, attributes, same, position=slice(0, 3), normal=slice(3, 6), **limits)
    return F, finer, attributes


def test_subdivision_splits_long_edges_opens_no_gap_and_rounds_a_ball():
    ball = meshes.ball(3)
    F, finer, attributes = refine(ball.shell, ball.faces, ball.shell, max_length=0.1, max_faces=20_000)
    edges = directed_edges(F)
    np.testing.assert_array_equal(np.unique(edges, axis=0), np.unique(edges[:, ::-1], axis=0))
    assert np.linalg.norm(finer[edges[:, 0], :3] - finer[edges[:, 1], :3], axis=1).max() <= 0.1
    np.testing.assert_array_equal(finer[: len(attributes)], attributes)
    # the coarse triangles' middles lie up to 0.06 under the sphere
    np.testing.assert_allclose(np.linalg.norm(finer[:, :3], axis=1), 1.0, atol=7e-3)
    np.testing.assert_allclose(finer[:, 3:6], finer[:, :3], atol=0.02)


def test_subdivision_keeps_creases_and_flat_faces_as_they_are():
    """A cube whose vertices are split at its edges, and one of whose faces is cut by a seam of texture coordinates."""
    cube = meshes.box(1)
    V, F = cube.positions(np.ones(3), np.full(3, 1e-9)), cube.faces
    large = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) > 1.0
    corners = V[F[large]].reshape(-1, 3).round(6)
    normals = np.repeat(triangle_normals(V, F[large]), 3, axis=0)
    fine, finer, _ = refine(corners, np.arange(len(corners)).reshape(-1, 3), normals, max_length=0.3, max_faces=5000)
    np.testing.assert_allclose(np.abs(finer[:, :3]).max(axis=1), 1.0, atol=1e-12)
    cross = np.cross(finer[fine[:, 1], :3] - finer[fine[:, 0], :3], finer[fine[:, 2], :3] - finer[fine[:, 0], :3])
    assert np.linalg.norm(cross, axis=1).sum() / 2 == pytest.approx(24.0, rel=1e-9)


def test_a_seam_of_texture_coordinates_is_no_crease():
    ball = meshes.ball(4)
    # every triangle has vertices of its own, which differ in nothing that counts
    V, F = ball.shell[ball.faces].reshape(-1, 3), np.arange(3 * len(ball.faces)).reshape(-1, 3)
    seams = refine(V, F, V, same=ball.faces.ravel(), max_length=0.2, max_faces=5000)[1][:, :3]
    whole = refine(ball.shell, ball.faces, ball.shell, max_length=0.2, max_faces=5000)[1][:, :3]
    np.testing.assert_allclose(np.unique(seams.round(12), axis=0), np.unique(whole.round(12), axis=0), atol=1e-11)


def test_subdivision_stops_at_the_budget():
    ball = meshes.ball(8)
    F = refine(ball.shell, ball.faces, ball.shell, max_length=1e-3, max_faces=5000)[0]
    assert 2500 < len(F) <= 5000


def test_unknown_look_names_the_valid_ones(gl):
    with pytest.raises(RippleError, match="'chrome'.*" + ".*".join(LOOKS)):
        make(gl, surface=ball_surface(look="chrome"))


@pytest.mark.parametrize("size", [(0, 100), (100, -1), (10**6, 100)])
def test_frame_sizes_that_the_driver_cannot_make_are_refused(gl, size):
    with pytest.raises(RippleError, match="frame size"):
        make(gl, size=size)


def test_a_height_map_of_another_resolution_is_refused(gl):
    renderer, data, target = make(gl)
    with pytest.raises(RippleError, match="height map"):
        renderer.render(data, {target: np.zeros((6, 8, 8, 4), dtype=np.float32)}, FRONT)


def test_water_shows_what_is_behind_it_and_clay_does_not(gl):
    """A wall behind the ball tints the middle of the frame through a clear body alone."""

    def middle(look: str, rgba: str) -> np.ndarray:
        wall = f'<geom type="box" size="4 .1 4" pos="0 3 0" rgba="{rgba}"/></worldbody>'
        renderer, data, _ = make(gl, LONE_BALL.replace("</worldbody>", wall), ball_surface(look=look))
        return renderer.render(data, {}, FRONT)[80:100, 110:130].mean(axis=(0, 1))

    for look, seen in (("water", True), ("clay", False)):
        change = middle(look, "0 0 1 1") - middle(look, "1 0 0 1")
        assert bool(change[2] > 30) is seen, (look, change)
