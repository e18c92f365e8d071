"""How exact are the eigenvalues of the patch layout's operator, where theory knows them?

    python examples/benchmarks/eigenvalues.py [--resolutions 32 64 96 128] [--meshes MESH ...]

Mean relative error of the eigenvalues 2 to 20 (1 to 20 with a fixed rim, where none is zero) of
five surfaces, at some resolutions, and its order by regression over the texels along a side. The
meshes' vertices lie on the true surfaces, and the texels of curved ones are put there too, so that
no facet counts as an error; the square is taken as it is built. The operator is that of
`WaveSolver`, with masses evened out for the sake of the time step. After the sphere comes the cube
layout of the same sphere, and how the patches' errors stand to it at equal texels.

With `--meshes` those are taken as they are instead, texels on their facets, in each layout that
fits them; the first line of a mesh says which of them `layout="auto"` takes. The reference are
quadratic finite elements on the same polyhedron; beside it stand linear ones with lumped masses, as
triangle meshes are often solved, on its triangles cut in four, once and twice.
"""

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path

import igl
import numpy as np
import trimesh
from scipy.linalg import eigh
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import eigsh
from scipy.spatial import Delaunay
from scipy.special import jn_zeros, jnp_zeros

from ripple_sim.solver import (
    Atlas,
    Material,
    Mesh,
    MeshError,
    TexelMesh,
    build_atlas,
    build_operator,
    load_mesh,
)
from ripple_sim.solver.mesh.mesh import check_genus_zero
from ripple_sim.solver.texels import stiffness_matrix

COUNT = 20
# radii of the torus and of its tube
RING = 1.0
TUBE = 0.4
RINGS = 40  # of vertices on disk and hemisphere

Points = Values = np.ndarray


# Meshes
# -------------------------------------------------------------------------------------------------


def grid(columns: int, rows: int, place: Callable, closed: bool = False) -> Mesh:
    """Squares cut into triangles; a closed grid ends where it begins.

    `place` maps two arrays from 0 to 1 to points.
    """
    a, b = np.meshgrid(np.arange(columns + 1) / columns, np.arange(rows + 1) / rows, indexing="ij")
    V = np.stack(np.broadcast_arrays(*place(a, b)), axis=-1).reshape(-1, 3)
    node = np.arange(len(V)).reshape(columns + 1, rows + 1)
    if closed:
        node[-1], node[:, -1] = node[0], node[:, 0]
    p = node[:-1, :-1].ravel()
    q = node[1:, :-1].ravel()
    r = node[1:, 1:].ravel()
    s = node[:-1, 1:].ravel()
    F = np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])
    used, F = np.unique(F, return_inverse=True)
    return Mesh.from_arrays(V[used], F.reshape(-1, 3))


def rings(place: Callable) -> Mesh:
    """Rings of 6, 12, 18 ... points around a centre.

    `place` maps radii from 0 to 1, cosines and sines to points.
    """
    radius = np.repeat(np.arange(RINGS + 1), np.maximum(6 * np.arange(RINGS + 1), 1))
    number = np.concatenate([np.arange(max(6 * k, 1)) for k in range(RINGS + 1)])
    angle = number * 2 * np.pi / np.maximum(6 * radius, 1)
    x = np.cos(angle)
    y = np.sin(angle)
    r = radius / RINGS
    F = Delaunay(np.stack([r * x, r * y], axis=1)).simplices
    u, v = (
        np.stack([(r * x)[F[:, k]] - (r * x)[F[:, 0]], (r * y)[F[:, k]] - (r * y)[F[:, 0]]])
        for k in (1, 2)
    )
    F[u[0] * v[1] < u[1] * v[0]] = F[u[0] * v[1] < u[1] * v[0]][:, ::-1]
    return Mesh.from_arrays(np.stack(place(r, x, y), axis=1), F)


def sphere() -> Mesh:
    solid = trimesh.creation.icosphere(5)
    return Mesh.from_arrays(solid.vertices, solid.faces)


def torus() -> Mesh:
    def place(a: Points, b: Points) -> tuple[Points, Points, Points]:
        u = 2 * np.pi * a
        v = 2 * np.pi * b
        rho = RING + TUBE * np.cos(v)
        return rho * np.cos(u), rho * np.sin(u), TUBE * np.sin(v)

    return grid(120, 48, place, closed=True)


def hemisphere() -> Mesh:
    return rings(
        lambda r, x, y: (
            np.sin(np.pi / 2 * r) * x,
            np.sin(np.pi / 2 * r) * y,
            np.cos(np.pi / 2 * r),
        )
    )


def disk() -> Mesh:
    return rings(lambda r, x, y: (r * x, r * y, 0 * r))


def square() -> Mesh:
    return grid(40, 40, lambda a, b: (a, b, 0 * a))


# The true surface nearest to a point of its mesh
# --------------------------------------------------------------------


def on_sphere(points: Points) -> Points:
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


def on_torus(points: Points) -> Points:
    ring = points * [1, 1, 0]
    ring *= RING / np.linalg.norm(ring, axis=-1, keepdims=True)
    return ring + TUBE * on_sphere(points - ring)


def on_disk(points: Points) -> Points:
    """The regular polygon of the mesh's rim, stretched along its radii to the circle."""
    side = np.pi / (3 * RINGS)
    within = np.arctan2(points[..., 1], points[..., 0]) % side - side / 2
    return points * (np.cos(within) / np.cos(side / 2))[..., None]


# Exact eigenvalues
# --------------------------------------------------------------------------------------------------


def degrees(multiplicity: Callable[[int], int]) -> Values:
    return np.concatenate([np.full(multiplicity(d), d * (d + 1.0)) for d in range(40)])


def torus_values() -> Values:
    """Eigenvalues of the torus.

    The modes are waves around the axis times a function around the tube, found by Fourier series.
    """
    n = 121
    v = 2 * np.pi * np.arange(n) / n
    apart = np.subtract.outer(np.arange(n), np.arange(n))
    half = np.sin(np.pi * apart / n)
    slope = np.where(apart, 0.5 * (-1.0) ** apart / np.where(apart, half, 1), 0)
    rho = RING + TUBE * np.cos(v)
    values = []
    for m in range(40):
        stiffness = slope.T @ np.diag(rho) @ slope / TUBE**2 + np.diag(m**2 / rho)
        values.append(
            np.repeat(eigh(stiffness, np.diag(rho), eigvals_only=True)[:40], 1 if m == 0 else 2)
        )
    return np.concatenate(values)


def disk_values(zeros: Callable, least: int = 0) -> Values:
    """Squares of the zeros of Bessel functions or their derivatives, twice but for order 0."""
    values = [np.repeat(zeros(m, 20) ** 2, 1 if m == 0 else 2) for m in range(20)]
    return np.concatenate([np.zeros(least), *values])


def square_values(first: int) -> Values:
    a, b = np.meshgrid(np.arange(first, 30), np.arange(first, 30))
    return np.pi**2 * (a**2 + b**2).ravel()


@dataclasses.dataclass(frozen=True)
class Case:
    """A surface: its mesh, its rim, its eigenvalues, and the map to the true surface.

    The map is None where the mesh is the true surface.
    """

    mesh: Callable[[], Mesh]
    project: Callable[[Points], Points] | None
    rim: str
    exact: Values


def cases() -> dict[str, Case]:
    return {
        "sphere": Case(sphere, on_sphere, "free", degrees(lambda d: 2 * d + 1)),
        "torus": Case(torus, on_torus, "free", torus_values()),
        "hemisphere, free": Case(hemisphere, on_sphere, "free", degrees(lambda d: d + 1)),
        "hemisphere, fixed": Case(hemisphere, on_sphere, "fixed", degrees(lambda d: d)),
        "disk, free": Case(disk, on_disk, "free", disk_values(jnp_zeros, 1)),
        "disk, fixed": Case(disk, on_disk, "fixed", disk_values(jn_zeros)),
        "square, free": Case(square, None, "free", square_values(0)),
        "square, fixed": Case(square, None, "fixed", square_values(1)),
    }


# Measured
# -------------------------------------------------------------------------------------------------


def placed(atlas: Atlas, project: Callable[[Points], Points] | None) -> Atlas:
    """The atlas with its texels on the true surface."""
    if project is None:
        return atlas
    texels = atlas.texels
    beyond = None if texels.beyond is None else project(texels.beyond)
    return dataclasses.replace(
        atlas,
        texels=TexelMesh.of(
            texels.topology, project(texels.positions), normals=texels.normals, beyond=beyond
        ),
    )


def mean_error(atlas: Atlas, case: Case) -> float:
    """Mean relative error of the eigenvalues 2 to 20, without the constant mode."""
    return float(
        errors_against(np.sort(case.exact)[:COUNT], placed(atlas, case.project), case.rim).mean()
    )


def errors_against(exact: Values, atlas: Atlas, rim: str = "free") -> Values:
    """Relative errors of the first twenty eigenvalues, without the constant mode."""
    stiffness = stiffness_matrix(build_operator(atlas, Material(), "fem", rim).stencil)
    moving = exact > 1e-9 * exact[-1]
    return np.abs(least(stiffness, diags_array(atlas.areas.ravel()))[moving] / exact[moving] - 1)


def least(stiffness: csr_array, mass: csr_array) -> Values:
    """The twenty least eigenvalues.

    The solver may miss one of several equal eigenvalues at the end, so it is asked for more.
    """
    scale = float(mass.diagonal().sum())
    values = eigsh(
        scale * stiffness.tocsc(),
        COUNT + 4,
        mass.tocsc(),
        sigma=-0.5,
        which="LM",
        return_eigenvectors=False,
    )
    return np.sort(values)[:COUNT] / scale


def halved(mesh: Mesh, times: int) -> tuple[Points, Values]:
    V = mesh.V
    F = mesh.F
    for _ in range(times):
        V, F = trimesh.remesh.subdivide(V, F)
    return V, F


def of_linear_elements(V: Points, F: Values) -> Values:
    """The twenty least eigenvalues of a mesh by cotangent weights and vertex areas; free rims."""
    return least(
        csr_array(-igl.cotmatrix(V, F)),
        csr_array(igl.massmatrix(V, F, igl.MASSMATRIX_TYPE_BARYCENTRIC)),
    )


def of_polyhedron(mesh: Mesh, halvings: int) -> Values:
    """The twenty least eigenvalues of a mesh by quadratic elements on half triangles; free rims."""
    V, F = halved(mesh, halvings)
    sides = np.sort(F[:, [[0, 1], [1, 2], [2, 0]]], axis=-1).reshape(-1, 2)
    edges, of_side = np.unique(sides, axis=0, return_inverse=True)
    nodes = np.hstack([F, len(V) + of_side.reshape(-1, 3)])
    across = V[F[:, [2, 0, 1]]] - V[F[:, [1, 2, 0]]]  # the side opposite to each corner
    areas = np.linalg.norm(np.cross(across[:, 0], across[:, 1]), axis=1) / 2
    # of barycentrics, multiplied
    slopes = np.einsum("tik,tjk->tij", across, across) / (4 * areas**2)[:, None, None]
    stiffness = np.zeros((len(F), 6, 6))
    # exact for products of linear slopes
    for place in ((0.5, 0.5, 0), (0, 0.5, 0.5), (0.5, 0, 0.5)):
        share = np.zeros(
            (6, 3)
        )  # [function, barycentric]: slopes of the six functions, by slopes of the barycentrics
        for i in range(3):
            j = (i + 1) % 3
            share[i, i] = 4 * place[i] - 1
            share[3 + i, i] = 4 * place[j]
            share[3 + i, j] = 4 * place[i]
        stiffness += np.einsum("ai,tij,bj->tab", share, slopes, share) * (areas / 3)[:, None, None]
    corner = 7 * np.eye(3) - 1
    side = 16 * np.eye(3) + 16
    far = -4 * np.eye(3)[[1, 2, 0]]  # a corner and the side opposite to it
    mass = areas[:, None, None] / 180 * np.block([[corner, far], [far.T, side]])
    rows = np.repeat(nodes, 6, axis=1).ravel()
    columns = np.tile(nodes, 6).ravel()
    size = len(V) + len(edges)
    K, M = (
        csr_array((each.ravel(), (rows, columns)), shape=(size, size)) for each in (stiffness, mass)
    )
    return least(K, M)


def line(name: str, texels: list[int], errors: list[float]) -> str:
    order = -np.polyfit(np.log(texels) / 2, np.log(errors), 1)[0]
    figures = "".join(
        f"{count:>9,} {error:8.2e}" for count, error in zip(texels, errors, strict=True)
    )
    return f"{name:<20}{figures}  {order:5.2f}"


def fits_cube(mesh: Mesh) -> bool:
    try:
        check_genus_zero(mesh)
    except MeshError:
        return False
    return True


def polyhedra(names: list[str], resolutions: list[int]) -> None:
    """Meshes as they are: mean and worst relative error, in each layout that fits them."""
    for name in names:
        mesh = load_mesh(name)
        coarser, exact = (of_polyhedron(mesh, halvings) for halvings in (0, 1))
        change = np.abs(exact[1:] / coarser[1:] - 1).max()
        chosen = build_atlas(mesh, resolutions[0]).layout
        print(
            f"{Path(name).name}, {len(mesh.F):,} triangles, auto takes {chosen}; "
            f"halving them changes the reference by {change:.1e}"
        )
        for layout in ("cube", "patches") if fits_cube(mesh) else ("patches",):
            atlases = [build_atlas(mesh, n, layout=layout) for n in resolutions]
            errors = np.array([errors_against(exact, atlas) for atlas in atlases])
            texels = [atlas.areas.size for atlas in atlases]
            print(line(f"{layout}, mean", texels, errors.mean(axis=1)))
            print(line(f"{layout}, worst", texels, errors.max(axis=1)), flush=True)
        meshes = [halved(mesh, times) for times in (1, 2)]
        errors = np.array(
            [np.abs(of_linear_elements(*each)[1:] / exact[1:] - 1) for each in meshes]
        )
        print(line("triangles, mean", [len(V) for V, _ in meshes], errors.mean(axis=1)))
        print(line("triangles, worst", [len(V) for V, _ in meshes], errors.max(axis=1)), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Eigenvalues of the patch layout against exact ones."
    )
    parser.add_argument("--resolutions", type=int, nargs="+", default=[32, 64, 96, 128])
    parser.add_argument(
        "--meshes",
        nargs="+",
        default=[],
        help="meshes to take as they are, facets and all, instead",
    )
    options = parser.parse_args()
    resolutions = options.resolutions
    if options.meshes:
        polyhedra(options.meshes, resolutions)
        return
    print(f"{'surface':<20}{'  texels    error' * len(resolutions)}  order")
    patches = None
    for name, case in cases().items():
        mesh = case.mesh()
        atlases = [build_atlas(mesh, n, layout="patches") for n in resolutions]
        errors = [mean_error(atlas, case) for atlas in atlases]
        texels = [atlas.areas.size for atlas in atlases]
        print(line(name, texels, errors), flush=True)
        if name == "sphere":
            patches = np.multiply(texels, errors)
            cube = [build_atlas(mesh, n, layout="cube") for n in resolutions]
            reference = [mean_error(atlas, case) for atlas in cube]
            sizes = [atlas.areas.size for atlas in cube]
            print(line("sphere, cube layout", sizes, reference))
            # errors go with the area of a texel, by which the few texels more or less are made up
            # for
            ratios = patches / np.multiply(sizes, reference)
            print(
                "patches over cube, at equal texels: "
                + ", ".join(f"{ratio:.2f}" for ratio in ratios)
            )


if __name__ == "__main__":
    main()
