"""Waves keep the symmetries of the cube and run equally fast in all directions."""

import numpy as np
import pytest
from arrival import front_and_crest
from cube_symmetry import cube_rotations, permute_texels

from ripple_sim.solver import Atlas, Mesh, WaveSolver, build_atlas, sphere_atlas
from ripple_sim.solver.texels import sampling_matrix

MIRROR = np.diag([1.0, 1.0, -1.0])
ALL_48 = np.concatenate([cube_rotations(), cube_rotations() @ MIRROR])


def ripple(atlas: Atlas, point: np.ndarray, backend: str, seconds: float = 0.9) -> np.ndarray:
    waves = WaveSolver(atlas, backend=backend)
    waves.add_impulse(point, 1.0, 0.25)
    waves.step(seconds)
    return waves.height


# two chart centres and two corners of the cube; the others as the rotated impulse
@pytest.mark.parametrize(
    ("point", "count"), [([1, 0, 0], 8), ([0, -1, 0], 8), ([1, 1, 1], 6), ([-1, 1, -1], 6)]
)
def test_impulse_keeps_the_symmetries_of_its_place_on_the_cube(
    point: list[int], count: int, backend: str
) -> None:
    place = point / np.linalg.norm(point)
    h = ripple(sphere_atlas(1.0, 32), place, backend)
    symmetries = ALL_48[np.abs(ALL_48 @ place - place).max(axis=1) < 1e-12]
    assert len(symmetries) == count
    for symmetry in symmetries:
        assert np.abs(permute_texels(h, symmetry) - h).max() < 1e-5 * np.abs(h).max()


def test_rotated_impulse_gives_the_rotated_field(backend: str) -> None:
    atlas = sphere_atlas(1.0, 32)
    point = np.array([0.31, -0.52, 0.79])
    h = ripple(atlas, point, backend)
    for rotation in cube_rotations():
        turned = ripple(atlas, rotation @ point, backend)
        assert np.abs(turned - permute_texels(h, rotation)).max() < 1e-5 * np.abs(h).max()


def test_rotated_impulse_on_a_fine_mesh_of_a_sphere(ball_mesh: Mesh) -> None:
    atlas = build_atlas(ball_mesh, 128)
    point = np.array([0.31, -0.52, 0.79])
    point /= np.linalg.norm(point)
    rng = np.random.default_rng(4)
    probes = rng.standard_normal((300, 3))
    probes /= np.linalg.norm(probes, axis=1, keepdims=True)
    fields = []
    for rotation in cube_rotations()[::4]:
        h = ripple(atlas, rotation @ point, "cpu")
        fields.append(sample(atlas, h, probes @ rotation.T))
    peak = np.abs(fields[0]).max()
    assert max(np.abs(field - fields[0]).max() for field in fields) < 0.01 * peak


def sample(atlas: Atlas, field: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Bilinear samples of a field at surface points."""
    return sampling_matrix(atlas.texels.topology, *atlas.locate(points)) @ field.ravel().astype(
        float
    )


@pytest.mark.parametrize("point", [[0, 0, 1], [1, 1, 1], [0.3, 0.9, -0.4]])
def test_first_crest_arrives_at_the_same_time_in_all_directions(point: list[float]) -> None:
    atlas = sphere_atlas(1.0, 96)
    p = np.array(point) / np.linalg.norm(point)
    side = np.cross(p, [0.6, -0.3, 0.7])
    side /= np.linalg.norm(side)
    angle = np.linspace(0, 2 * np.pi, 36, endpoint=False)[:, None]
    around = np.cos(angle) * side + np.sin(angle) * np.cross(p, side)
    distance = 1.0
    probes = np.cos(distance) * p + np.sin(distance) * around
    waves = WaveSolver(atlas, backend="cpu")
    waves.add_impulse(p, 1.0, 0.3)
    times = []
    signal = []
    for _ in range(130):
        waves.step(0.01)
        times.append(waves.time)
        signal.append(sample(atlas, waves.height, probes))
    _, arrivals = front_and_crest(np.array(times), -np.array(signal))  # an impulse presses in
    assert np.ptp(arrivals) < 0.01 * arrivals.mean()
    # and that time is about distance / speed, less the head start of the footprint's rim
    assert distance - 0.3 < arrivals.mean() < distance + 0.15
