"""Triangles joined in pairs: each once, and as well as the best of all pairings where these can be counted."""

import itertools

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from ripple_sim.solver.layouts.patches.quads import Joints, chosen_joints


def hull(points: int) -> tuple[Joints, int, np.ndarray]:
    """Triangles of the convex hull of random points, their sides, and how many meet in each point."""
    V = np.random.default_rng(points).normal(size=(points, 3))
    F = ConvexHull(V / np.linalg.norm(V, axis=1, keepdims=True)).simplices.astype(np.int64)
    pairs = [(i, j) for i, j in itertools.combinations(range(len(F)), 2) if len(set(F[i]) & set(F[j])) == 2]
    ends = [sorted(set(F[i]) & set(F[j])) for i, j in pairs]
    return Joints(np.array(pairs), np.array(ends), np.zeros(len(pairs))), len(F), np.bincount(F.ravel())


def pairings(pairs: np.ndarray, left: frozenset[int]) -> list[list[int]]:
    if not left:
        return [[]]
    here = min(left)
    ways = [k for k in range(len(pairs)) if here in pairs[k] and set(pairs[k]) <= left]
    return [[k, *rest] for k in ways for rest in pairings(pairs, left - set(pairs[k]))]


def off(joints: Joints, corners: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """By how much the quads round each point differ from four."""
    return np.abs(corners - np.bincount(joints.middles[chosen].ravel(), minlength=len(corners)) - 4)


@pytest.mark.parametrize("points", [12, 14])
def test_the_best_of_all_pairings_is_found(points: int) -> None:
    joints, count, corners = hull(points)
    chosen = chosen_joints(joints, count, corners, np.full(points, 4.0))
    assert chosen is not None
    assert (np.bincount(joints.triangles[chosen].ravel()) == 1).all()
    ways = [off(joints, corners, np.array(each)) for each in pairings(joints.triangles, frozenset(range(count)))]
    cost = [(each + 2 * np.maximum(each - 1, 0)).sum() for each in ways if each.max() < 2]
    found = off(joints, corners, chosen)
    assert (found + 2 * np.maximum(found - 1, 0)).sum() == min(cost)


def test_where_their_number_is_odd_one_triangle_stays_alone() -> None:
    # three in a row, round points that have enough of others
    joints = Joints(
        np.array([[0, 1], [1, 2], [0, -1], [2, -1]]), np.array([[0, 1], [1, 2], [3, 4], [5, 6]]), np.zeros(4)
    )
    chosen = chosen_joints(joints, 3, np.full(7, 5), np.full(7, 4.0))
    assert chosen is not None
    alone = joints.triangles[chosen, 1] < 0
    assert alone.sum() == 1
    assert sorted(joints.triangles[chosen][joints.triangles[chosen] >= 0]) == [0, 1, 2]


def test_there_is_no_pairing_of_triangles_that_have_no_side_in_common() -> None:
    none = Joints(np.empty((0, 2), np.int64), np.empty((0, 2), np.int64), np.empty(0))
    assert chosen_joints(none, 2, np.full(3, 5), np.full(3, 4.0)) is None
