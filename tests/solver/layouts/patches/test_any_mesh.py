"""Whatever is thrown at the patch layout: handles, holes, strips, a one-sided band, single triangles, needles."""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from surfaces import grid, sphere

from ripple_sim.solver import Atlas, Material, Mesh, WaveSolver, build_atlas
from ripple_sim.solver.layouts.patches import layout


def thick_graph(genus: int) -> Mesh:
    """A random connected graph on the corners of a cube, with so many cycles, its edges bars of square section."""
    rng = np.random.default_rng(genus)
    corners = np.stack(np.meshgrid(*[[0, 2]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    pairs = [(i, j) for i in range(8) for j in range(i) if np.abs(corners[i] - corners[j]).sum() == 2]
    part, chosen, closing = np.arange(8), [], []
    for k in rng.permutation(len(pairs)):
        i, j = pairs[k]
        (closing if part[i] == part[j] else chosen).append(pairs[k])
        part[part == part[j]] = part[i]
    filled = np.zeros((5, 5, 5), bool)
    filled[tuple(corners.T + 1)] = True
    for i, j in chosen + closing[:genus]:
        filled[tuple((corners[i] + corners[j]) // 2 + 1)] = True
    return Mesh.from_arrays(*boundary(filled, rng))


def boundary(filled: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Squares between filled and empty boxes, cut in two, with shaken vertices."""
    squares = []
    for axis in range(3):
        step = np.eye(3, dtype=int)[axis]
        across = [np.eye(3, dtype=int)[(axis + k) % 3] for k in (1, 2)]
        for side in (-1, 1):
            at = np.argwhere(filled & ~np.roll(filled, -side, axis=axis))
            base = at + step * (side > 0)
            ring = [0 * step, across[0], across[0] + across[1], across[1]][::side]
            squares.append(np.stack([base + each for each in ring], axis=1))
    V, corner = np.unique(np.concatenate(squares).reshape(-1, 3), axis=0, return_inverse=True)
    corner = corner.reshape(-1, 4)
    return V + rng.uniform(-0.2, 0.2, V.shape), np.concatenate([corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]])


def holed_sphere(holes: int) -> Mesh:
    """A sphere without the caps round some random directions."""
    solid = trimesh.creation.icosphere(3)
    centres = np.random.default_rng(holes).normal(size=(holes, 3))
    centres /= np.linalg.norm(centres, axis=1, keepdims=True)
    kept = (solid.triangles_center @ centres.T < 0.93).all(axis=1)
    return Mesh.from_arrays(solid.vertices, solid.faces[kept])


def moebius_band() -> Mesh:
    """A strip that closes after half a turn; it is cut open, being one-sided."""
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, 41), np.linspace(-0.3, 0.3, 5), indexing="ij")
    radius, z = 1 + b * np.cos(a / 2), b * np.sin(a / 2)
    V = np.stack([radius * np.cos(a), radius * np.sin(a), z], axis=-1).reshape(-1, 3)
    node = np.arange(41 * 5).reshape(41, 5)
    p, q, r, s = node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]
    F = np.concatenate([np.stack([p, q, r], axis=-1), np.stack([p, r, s], axis=-1)]).reshape(-1, 3)
    return Mesh.from_arrays(V.round(9), F)


CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
MESHES: dict[str, Callable[[], Mesh]] = {
    **{f"graph of genus {genus}": (lambda genus=genus: thick_graph(genus)) for genus in (0, 2, 5)},
    "sphere with 1 hole": lambda: holed_sphere(1),
    "sphere with 6 holes": lambda: holed_sphere(6),
    "strip": lambda: Mesh.from_arrays(*grid(12, lambda x, y: (10 * x, y, 0 * x))),
    "Moebius band": moebius_band,
    "1 triangle": lambda: Mesh.from_arrays(CORNERS, [[0, 1, 2]]),
    "2 triangles": lambda: Mesh.from_arrays(CORNERS, [[0, 1, 2], [1, 3, 2]]),
    "4 triangles": lambda: Mesh.from_arrays(CORNERS, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
    "needle": lambda: Mesh.from_arrays([[0, 0, 0], [1, 0, 0], [0.5, 0.05, 0]], [[0, 1, 2]]),
    "needles": lambda: Mesh.from_arrays(sphere(1).V * [1, 1, 10], sphere(1).F),
}


@pytest.mark.parametrize("name", MESHES)
def test_any_mesh_carries_waves(name: str) -> None:
    assert_atlas_carries_waves(build_atlas(MESHES[name](), 16, cache=False, layout="patches"))


def assert_atlas_carries_waves(atlas: Atlas) -> None:
    quality = atlas.quality()
    assert quality["flipped"] == 0
    assert np.isfinite(atlas.positions).all()
    assert (atlas.areas > 0).all()
    assert quality["coverage"] == pytest.approx(1.0, abs=0.02)
    assert_waves_are_stable(atlas)


def assert_waves_are_stable(atlas: Atlas) -> None:
    waves = WaveSolver(atlas, Material(speed=1.0), backend="cpu")
    waves.add_impulse(atlas.positions[0, 1, 1], 1e-3, 0.0)
    before = waves.energy()
    waves.step(64 * waves.stable_timestep)
    assert waves.energy() < 1.5 * before


def test_many_parts_none_of_which_has_a_share_to_speak_of(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with a thousand parts, in less time."""
    monkeypatch.setattr(layout, "_NEGLIGIBLE", 0.3)
    solid = trimesh.creation.box((1, 1, 1))
    V = np.concatenate([solid.vertices + np.array([2 * i, 0, 0]) for i in range(4)])
    F = np.concatenate([solid.faces + len(solid.vertices) * i for i in range(4)])
    assert_atlas_carries_waves(build_atlas(Mesh.from_arrays(V, F), resolution=16, cache=False))
