"""Triangles on primitives lie on the surface that MuJoCo collides, and nowhere else."""

import mujoco
import numpy as np
import pytest
import trimesh

from ripple_sim.coupling.target_mesh import primitive_triangles

SOLIDS = [
    ("sphere", (0.2,)),
    ("ellipsoid", (0.3, 0.2, 0.1)),
    ("ellipsoid", (0.02, 0.5, 0.5)),
    ("capsule", (0.1, 0.2)),
    ("capsule", (0.2, 0.01)),
    ("cylinder", (0.2, 0.1)),
    ("cylinder", (0.05, 0.4)),
    ("box", (0.2, 0.3, 0.1)),
    ("box", (1.0, 1.0, 0.01)),
]
every_solid = pytest.mark.parametrize(("kind", "size"), SOLIDS)


def triangles(kind: str, size: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    return primitive_triangles(kind, np.array([*size, 0.0, 0.0][:3]))


def distances(kind: str, size: tuple[float, ...], points: np.ndarray) -> np.ndarray:
    """Signed distances from the exact solid [m]; for an ellipsoid in units of its own half-axes."""
    if kind in ("sphere", "ellipsoid"):
        return np.linalg.norm(points / np.resize(size, 3), axis=1) - 1
    around = np.linalg.norm(points[:, :2], axis=1)
    if kind == "capsule":
        along = np.maximum(np.abs(points[:, 2]) - size[1], 0)
        return np.hypot(around, along) - size[0]
    beyond = np.abs(points) - size if kind == "box" else np.column_stack([around, np.abs(points[:, 2])]) - size
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def mesh_of(kind: str, size: tuple[float, ...]) -> trimesh.Trimesh:
    return trimesh.Trimesh(*triangles(kind, size), process=False, validate=False)


@every_solid
def test_vertices_lie_on_the_exact_surface(kind: str, size: tuple[float, ...]) -> None:
    V, _ = triangles(kind, size)
    np.testing.assert_allclose(distances(kind, size, V), 0, atol=1e-12)


@every_solid
def test_the_surface_is_closed_without_handles_and_faces_outwards(kind: str, size: tuple[float, ...]) -> None:
    mesh = mesh_of(kind, size)
    mesh.merge_vertices()
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2
    assert mesh.volume > 0


@every_solid
def test_no_edge_is_longer_than_a_24th_of_the_solid(kind: str, size: tuple[float, ...]) -> None:
    V, F = triangles(kind, size)
    edges = np.linalg.norm(V[F] - V[np.roll(F, -1, axis=1)], axis=2)
    # moved outwards onto a round surface, an edge grows a little
    assert edges.max() <= 1.02 * np.ptp(V, axis=0).max() / 24
    assert np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1).min() > 0


@pytest.mark.parametrize(
    ("kind", "size", "volume", "area"),
    [
        ("box", (0.2, 0.3, 0.1), 0.048, 0.88),
        ("capsule", (0.1, 0.2), np.pi * (0.004 + 0.004 / 3), np.pi * (0.08 + 0.04)),
        ("cylinder", (0.2, 0.1), np.pi * 0.008, np.pi * (0.08 + 0.08)),
        ("ellipsoid", (0.3, 0.3, 0.3), 4 / 3 * np.pi * 0.027, 4 * np.pi * 0.09),
    ],
)
def test_volume_area_and_moments_are_those_of_the_solid(
    kind: str, size: tuple[float, ...], volume: float, area: float
) -> None:
    mesh = mesh_of(kind, size)
    assert mesh.volume == pytest.approx(volume, rel=3e-3)
    assert mesh.area == pytest.approx(area, rel=3e-3)
    np.testing.assert_allclose(mesh.center_mass, 0, atol=1e-6)
    # MuJoCo's own inertia of the same solid, at a density of 1
    geom = f'<geom type="{kind}" size="{" ".join(map(str, size))}" density="1"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody><body><freejoint/>{geom}</body></worldbody></mujoco>")
    assert mesh.volume == pytest.approx(model.body_mass[1], rel=3e-3)
    np.testing.assert_allclose(np.sort(np.diag(mesh.moment_inertia)), np.sort(model.body_inertia[1]), rtol=6e-3)


@pytest.mark.parametrize("scale", [2.0**-17, 2.0**17])
@every_solid
def test_triangles_are_alike_at_every_scale(kind: str, size: tuple[float, ...], scale: float) -> None:
    V, F = triangles(kind, size)
    scaled, same = triangles(kind, tuple(scale * x for x in size))
    np.testing.assert_array_equal(F, same)
    np.testing.assert_allclose(scaled, scale * V, rtol=0, atol=1e-12 * scale)
