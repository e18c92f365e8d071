"""Closed surfaces of genus 0, from tame to hard; and how evenly a sphere map spreads their area."""

import igl
import numpy as np
import trimesh

from ripple_sim.solver.layouts.sphere_map import stretch

TETRAHEDRON = (
    np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float),
    np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),
)


def icosphere(subdivisions):
    mesh = trimesh.creation.icosphere(subdivisions)
    return np.array(mesh.vertices), np.array(mesh.faces)


def solid(mesh):
    return np.array(mesh.vertices), np.array(mesh.faces)


def bipyramid(sides):
    angle = 2 * np.pi / sides * np.arange(sides)
    V = np.vstack(
        [np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), [[0, 0, 1], [0, 0, -1]]]
    )
    i = np.arange(sides)
    j = (np.arange(sides) + 1) % sides
    top = np.full(sides, sides)
    bottom = np.full(sides, sides + 1)
    return V, np.vstack([np.stack([i, j, top], axis=1), np.stack([j, i, bottom], axis=1)])


def stretched(factors, subdivisions=3):
    V, F = icosphere(subdivisions)
    return V * factors, F


def spiky(height, seed=0):
    V, F = icosphere(3)
    V[np.random.default_rng(seed).choice(len(V), 12, replace=False)] *= height
    return V, F


def crumpled(seed=0):
    V, F = icosphere(3)
    return V + 0.2 * np.random.default_rng(seed).standard_normal(V.shape), F


def thin_limb(length, radius):
    """A sphere, one of whose sides is drawn out to a limb."""
    V, F = icosphere(4)
    up = np.clip((V[:, 2] - 0.8) / 0.2, 0, 1)
    narrow = 1 - (1 - radius) * np.minimum(4 * up, 1)
    return np.column_stack([V[:, 0] * narrow, V[:, 1] * narrow, V[:, 2] + length * up]), F


def jack(limb_radius=0.12, limb_length=1.7, points=48):
    """Six thin limbs along the axes, from a signed distance."""
    axis = np.linspace(-2, 2, points)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    P = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    distance = np.full(len(P), np.inf)
    for k in range(3):
        nearest = np.zeros_like(P)
        nearest[:, k] = np.clip(P[:, k], -limb_length, limb_length)
        distance = np.minimum(distance, np.linalg.norm(P - nearest, axis=1) - limb_radius)
    V, F = igl.marching_cubes(distance, P, points, points, points, 0.0)[:2]
    if np.einsum("ij,ij->", V[F[:, 0]], np.cross(V[F[:, 1]], V[F[:, 2]])) < 0:
        F = F[:, ::-1]
    return V, np.ascontiguousarray(F)


SHAPES = {
    "tetrahedron": lambda: TETRAHEDRON,
    "octahedron": lambda: bipyramid(4),
    "cube of 12 triangles": lambda: solid(trimesh.creation.box()),
    "flat slab": lambda: solid(trimesh.creation.box(extents=[1, 1, 0.01])),
    "vertex of degree 500": lambda: bipyramid(500),
    "sphere": lambda: icosphere(3),
    "cigar 100:1": lambda: stretched([1, 1, 100]),
    "pancake 100:1": lambda: stretched([100, 100, 1]),
    "cylinder of slivers": lambda: solid(
        trimesh.creation.cylinder(radius=1, height=50, sections=100)
    ),
    "spikes of 100 radii": lambda: spiky(100),
    "one needle": lambda: (lambda V, F: (np.vstack([V[:1] * 1000, V[1:]]), F))(*icosphere(2)),
    "crumpled, self-intersecting": crumpled,
    "six limbs": jack,
}


def stretch_quantiles(V, F, S, quantiles=(0.001, 0.01, 0.5, 0.99, 0.999)):
    """Quantiles of the stretch by area: the value that a share of the area stays under."""
    values = stretch(V, F, S)
    weights = igl.doublearea(V, F)
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weights[order]) / np.sum(weights)
    return values[order][np.minimum(np.searchsorted(share, quantiles), len(order) - 1)]
