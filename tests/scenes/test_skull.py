"""The head with a skull: bone is where it should be, and a scan of the head alone tells as much as the meshes do."""

import numpy as np
import pytest

from ripple_sim.scenes import skull
from ripple_sim.scenes.face import FOLDER
from ripple_sim.scenes.sphere_maps import shipped_sphere_map
from ripple_sim.solver import Atlas, Mesh, Volume, build_atlas, load_mesh, thickness_map

LIMITS = (0.0, 0.15)
# Forehead, cheek and nose tip, where the balls of the scene hit [m].
PLACES = np.array([[0.2357, 0.0, 0.5825], [0.2185, 0.1904, 0.2997], [0.3707, 0.0, 0.3445]])
VOXEL = 0.015


def at(atlas: Atlas, field: np.ndarray, points: np.ndarray) -> np.ndarray:
    chart, row, column = atlas.locate(points)
    return field[chart, np.rint(row).astype(int), np.rint(column).astype(int)]


@pytest.fixture(scope="module")
def meshes() -> tuple[Atlas, np.ndarray]:
    """Atlas of the shipped head, and the thickness over the shipped skull."""
    face = load_mesh(FOLDER / "face.obj")
    atlas = build_atlas(face, 48, sphere=shipped_sphere_map(face), cache=False)
    return atlas, thickness_map(atlas, load_mesh(skull.FILE), LIMITS)


def test_bone_is_near_under_the_forehead_and_deep_under_cheek_and_nose(meshes: tuple[Atlas, np.ndarray]) -> None:
    forehead, cheek, nose = at(*meshes, PLACES)
    assert forehead < 0.035
    assert cheek > 3 * forehead
    assert nose > 1.2 * cheek
    assert meshes[1].min() > 0.015  # it is inside everywhere


def test_a_scan_of_the_head_alone_gives_the_same_thickness_within_a_voxel(meshes: tuple[Atlas, np.ndarray]) -> None:
    values, origin = skull.head_volume(VOXEL)
    skin, bone = (Volume(values, level, VOXEL, origin) for level in (skull.SKIN_THRESHOLD, skull.BONE_THRESHOLD))
    atlas = build_atlas(Mesh.from_arrays(*skin.surface()), 24, cache=False)
    thickness = thickness_map(atlas, bone, LIMITS)
    assert np.abs(at(atlas, thickness, PLACES) - at(*meshes, PLACES)).max() < VOXEL
    difference = np.abs(thickness - at(*meshes, atlas.positions.reshape(-1, 3)).reshape(thickness.shape))
    # sides of nose and ears have the far end of the head below them, or nothing, by a degree of the normal
    assert np.quantile(difference, 0.9) < VOXEL
    assert np.median(difference) < 0.2 * VOXEL


def test_the_shipped_skull_is_what_the_module_makes() -> None:
    V, F = skull.skull()
    shipped = load_mesh(skull.FILE)
    assert (len(shipped.V), len(shipped.F)) == (len(V), len(F))
    assert shipped.closed
    np.testing.assert_allclose(np.sort(shipped.V, axis=0), np.sort(V, axis=0), atol=1e-5)
