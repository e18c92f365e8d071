"""The patch layout's operator against eigenvalues that are known exactly: it is of second order on any surface."""

from collections.abc import Callable

import numpy as np
import pytest
from hand_made import eigenvalues
from surfaces import disk, sphere, square

from ripple_sim.solver import Mesh, TexelMesh
from ripple_sim.solver.layouts.patches.atlas import atlas_from_patch_map
from ripple_sim.solver.layouts.patches.layout import patch_map

MODES = 10


def on_sphere(points: np.ndarray) -> np.ndarray:
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


def hemisphere() -> Mesh:
    flat = disk(12)
    x, y, _ = flat.V.T
    angle = np.pi / 2 * np.hypot(x, y)
    across = np.sin(angle) / np.maximum(np.hypot(x, y), 1e-12)
    return Mesh.from_arrays(np.stack([across * x, across * y, np.cos(angle)], axis=1), flat.F)


def degrees(multiplicity: Callable[[int], int]) -> np.ndarray:
    return np.concatenate([np.full(multiplicity(d), d * (d + 1.0)) for d in range(9)])


def squares(first: int) -> np.ndarray:
    return np.sort([np.pi**2 * (a * a + b * b) for a in range(first, 9) for b in range(first, 9)])


def texel_meshes(mesh: Mesh, project: Callable[[np.ndarray], np.ndarray]) -> list[TexelMesh]:
    """At two resolutions, with the texels on the true surface."""
    patches = patch_map(mesh.V, mesh.F)
    meshes = []
    for n in (8, 16):
        texels = atlas_from_patch_map(mesh, patches, round(n * np.sqrt(len(patches.seamless.glued) / 6))).texels
        beyond = None if texels.beyond is None else project(texels.beyond)
        meshes.append(TexelMesh.of(texels.topology, project(texels.positions), normals=texels.normals, beyond=beyond))
    return meshes


@pytest.mark.parametrize(
    ("mesh", "project", "exact"),
    [
        (lambda: sphere(2), on_sphere, {"free": degrees(lambda d: 2 * d + 1)}),
        (hemisphere, on_sphere, {"free": degrees(lambda d: d + 1), "fixed": degrees(lambda d: d)}),
        (lambda: square(4), np.asarray, {"free": squares(0), "fixed": squares(1)}),
    ],
    ids=["sphere", "hemisphere", "square"],
)
def test_eigenvalues_are_of_second_order(mesh: Callable, project: Callable, exact: dict[str, np.ndarray]) -> None:
    meshes = texel_meshes(mesh(), project)
    for rim, values in exact.items():
        moving = values[:MODES] > 0
        errors = []
        for texels in meshes:
            found = eigenvalues(texels.with_fixed_rim() if rim == "fixed" else texels, MODES)
            errors.append(np.abs(found / np.where(moving, values[:MODES], 1) - 1)[moving])
        texel = np.sqrt([each.areas.mean() for each in meshes])
        order = np.log(errors[0].mean() / errors[1].mean()) / np.log(texel[0] / texel[1])
        assert order > 1.9, rim
        # the error of a mode of wave number k is that of the grid, (k texel)^2
        assert (errors[1] < 0.2 * values[:MODES][moving] * texel[1] ** 2).all(), rim
