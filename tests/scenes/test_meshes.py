"""The shipped meshes are those of examples/scene_meshes, and fit their scenes."""

import drum
import head
import igl
import mujoco
import numpy as np
import pytest
import terrain
import vessels

from ripple_sim.scenes import shapes
from ripple_sim.scenes.shapes import polygonise, sphere
from ripple_sim.scenes.sphere_maps import shipped_sphere_map
from ripple_sim.solver import Atlas, Mesh, Volume, build_atlas, load_mesh, thickness_map

LIMITS = (0.0, 0.15)
# Forehead, cheek and nose tip, where the balls of the scene `skull` hit [m].
PLACES = np.array([[0.2357, 0.0, 0.5825], [0.2185, 0.1904, 0.2997], [0.3707, 0.0, 0.3445]])
VOXEL = 0.015


@pytest.mark.parametrize(
    ("path", "made"),
    [
        (drum.SKIN_FILE, drum.skin),
        (drum.WALL_FILE, drum.wall),
        (head.FOLDER / "skull.obj", head.skull),
        (shapes.DUCK_FILE, shapes.duck),
        (shapes.LIMBED_FILE, shapes.limbed),
    ],
    ids=["drum's skin", "drum's wall", "skull", "duck", "limbed"],
)
def test_shipped_meshes_are_what_the_modules_make(path, made) -> None:
    V, F = made()
    shipped_V, _, _, shipped_F, *_ = igl.readOBJ(str(path))
    np.testing.assert_array_equal(shipped_F, F)
    np.testing.assert_allclose(shipped_V, V, rtol=1e-4, atol=1e-5)


def test_mujoco_reads_the_heights_that_the_landscape_has() -> None:
    heights = terrain.terrain()
    assert heights.min() == 0 and heights.max() == 1
    model = mujoco.MjModel.from_xml_path(str(terrain.TERRAIN_FILE.parents[1] / "terrain.xml"))
    np.testing.assert_allclose(model.hfield_data.reshape(heights.shape), heights, atol=1e-6)


def test_the_drums_skin_is_a_flat_disk_of_even_triangles_that_faces_up() -> None:
    V, F = drum.skin()
    a, b, c = (V[F[:, k]] for k in range(3))
    upwards = np.cross(b - a, c - a)[:, 2]
    assert upwards.min() > 0
    assert upwards.sum() / 2 == pytest.approx(np.pi * drum.RADIUS**2, rel=1e-3)
    assert igl.euler_characteristic(F) == 1
    assert np.degrees(igl.internal_angles(V, F)).min() > 40
    np.testing.assert_array_equal(V[:, 2], drum.HEIGHT)


def test_the_drums_wall_is_a_closed_tube_that_faces_outwards_and_stands_on_the_floor() -> None:
    V, F = drum.wall()
    assert len(igl.boundary_facets(F)[0]) == 0
    assert igl.euler_characteristic(F) == 0
    assert np.linalg.det(V[F]).sum() > 0
    assert V[:, 2].min() == 0


@pytest.mark.parametrize(
    ("path", "genus", "rims"), [(vessels.TEAPOT_FILE, [1, 0], 3), (vessels.PRETZEL_FILE, [3], 0)]
)
def test_vessels_have_their_handles_and_rims_and_no_slivers(path, genus, rims) -> None:
    mesh = load_mesh(path)
    assert not mesh.notes
    assert (mesh.genus.tolist(), len(mesh.rims)) == (genus, rims)
    assert np.degrees(igl.internal_angles(mesh.V, mesh.F)).min() > 10
    assert mesh.V[:, 2].min() == pytest.approx(0, abs=1e-4)


def test_a_ball_cut_open_ends_at_the_plane() -> None:
    ball = sphere((0.0, 0.0, 0.0), 0.5)
    V, F = vessels.opened(
        ball, *polygonise(ball, ((-0.6,) * 3, (0.6,) * 3), 0.05), (0.0, 0.0, 0.2), (0, 0, 1), 0.05
    )
    rim = np.unique(igl.boundary_facets(F)[0])
    np.testing.assert_allclose(V[rim, 2], 0.2, atol=2e-4)
    np.testing.assert_allclose(np.linalg.norm(V, axis=1), 0.5, atol=2e-3)
    assert V[:, 2].max() < 0.2 + 2e-4
    assert igl.euler_characteristic(F) == 1
    # Archimedes: a cap's area goes with its height
    assert igl.doublearea(V, F).sum() / 2 == pytest.approx(2 * np.pi * 0.5 * 0.7, rel=0.01)
    assert np.degrees(igl.internal_angles(V, F)).min() > 8


def at(atlas: Atlas, field: np.ndarray, points: np.ndarray) -> np.ndarray:
    chart, row, column = atlas.locate(points)
    return field[chart, np.rint(row).astype(int), np.rint(column).astype(int)]


@pytest.fixture(scope="module")
def meshes() -> tuple[Atlas, np.ndarray]:
    """Atlas of the shipped head, and the thickness over the shipped skull."""
    face = load_mesh(head.FOLDER / "face.obj")
    atlas = build_atlas(face, 48, sphere=shipped_sphere_map(face), cache=False)
    return atlas, thickness_map(atlas, load_mesh(head.FOLDER / "skull.obj"), LIMITS)


def test_bone_is_near_under_the_forehead_and_deep_under_cheek_and_nose(
    meshes: tuple[Atlas, np.ndarray],
) -> None:
    forehead, cheek, nose = at(*meshes, PLACES)
    assert forehead < 0.035
    assert cheek > 3 * forehead
    assert nose > 1.2 * cheek
    assert meshes[1].min() > 0.015  # it is inside everywhere


def test_a_scan_of_the_head_alone_gives_the_same_thickness_within_a_voxel(
    meshes: tuple[Atlas, np.ndarray],
) -> None:
    values, origin = head.head_volume(VOXEL)
    skin, bone = (
        Volume(values, level, VOXEL, origin) for level in (head.SKIN_THRESHOLD, head.BONE_THRESHOLD)
    )
    atlas = build_atlas(Mesh.from_arrays(*skin.surface()), 24, cache=False)
    thickness = thickness_map(atlas, bone, LIMITS)
    assert np.abs(at(atlas, thickness, PLACES) - at(*meshes, PLACES)).max() < VOXEL
    difference = np.abs(
        thickness - at(*meshes, atlas.positions.reshape(-1, 3)).reshape(thickness.shape)
    )
    # sides of nose and ears have the far end of the head below them, or nothing, by a degree of the
    # normal
    assert np.quantile(difference, 0.9) < VOXEL
    assert np.median(difference) < 0.2 * VOXEL
