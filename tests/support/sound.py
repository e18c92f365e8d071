"""A sound mesh: what must hold for every mesh after cleaning."""

import numpy as np

from ripple_sim.solver import Mesh


def assert_sound(mesh: Mesh) -> None:
    """Manifold, wound alike, all vertices in use, no empty triangle, closed parts outward."""
    F = mesh.F
    assert F.min() == 0
    assert len(np.unique(F)) == len(mesh.V) == F.max() + 1
    half_edges = np.stack([F, np.roll(F, -1, axis=1)], axis=-1).reshape(-1, 2)
    forward = {(a, b) for a, b in half_edges.tolist()}
    # at most two triangles an edge, which run along it in opposite ways
    assert len(forward) == len(half_edges)
    sides = mesh.V[np.roll(F, -1, axis=1)] - mesh.V[F]
    with np.errstate(under="ignore"):
        area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    assert (area > 0).all()
    assert_single_fans(F)
    rim = [edge for edge in forward if edge[::-1] not in forward]
    loops = [
        tuple(edge)
        for loop in mesh.rims
        for edge in np.stack([loop, np.roll(loop, -1)], axis=1).tolist()
    ]
    assert sorted(rim) == sorted(loops)
    assert mesh.closed == (not rim)
    assert (mesh.genus >= 0).all()
    assert len(mesh.genus) == mesh.component_count
    euler = len(mesh.V) - (len(half_edges) + len(rim)) // 2 + len(F)
    assert euler == (2 - 2 * mesh.genus).sum() - len(mesh.rims)
    if mesh.corner_uv is not None:
        assert mesh.corner_uv.shape == (*F.shape, 2)


def assert_single_fans(F: np.ndarray) -> None:
    """At every vertex the triangles are connected over their sides."""
    onward: dict[int, dict[int, int]] = {}
    for a, b, c in [*F.tolist(), *F[:, [1, 2, 0]].tolist(), *F[:, [2, 0, 1]].tolist()]:
        onward.setdefault(a, {})[b] = c
    for ring in onward.values():
        begins = set(ring) - set(ring.values())
        assert len(begins) <= 1
        start = begins.pop() if begins else next(iter(ring))
        steps = 0
        at = start
        while at in ring and steps < len(ring):
            at = ring[at]
            steps += 1
        assert steps == len(ring)


def assert_unchanged_when_read_again(mesh: Mesh) -> None:
    again = Mesh.from_arrays(mesh.V, mesh.F, mesh.corner_uv)
    np.testing.assert_array_equal(again.V, mesh.V)
    np.testing.assert_array_equal(again.F, mesh.F)
    assert again.notes == ()
    if mesh.corner_uv is not None:
        np.testing.assert_array_equal(again.corner_uv, mesh.corner_uv)
        np.testing.assert_array_equal(again.uv, mesh.uv)
