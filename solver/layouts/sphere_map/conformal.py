"""The conformal sphere map of Choi, Lam and Lui (FLASH, 2015).

One triangle is cut out and the rest laid flat inside it by a harmonic map, which an inverse
stereographic projection puts on the sphere. Angles suffer near the cut, at the north pole. So the
map is projected from the south pole, where the cut lies in the middle of the plane, and composed
with the quasi-conformal map that undoes the distortion.

It keeps angles, not areas: limbs shrink beyond use, and badly shaped meshes fold. The progressive
map does neither.
"""

from __future__ import annotations

import warnings

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import MatrixRankWarning, spsolve

from ...errors import SphereMapError
from .certificate import certify

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Triangles = NDArray[np.integer]

# Share of the vertices, far from the cut, that stay where the harmonic map has put them; and how
# many do at least.
_SOUTHERN_SHARE = 0.1
_MIN_SOUTHERN_VERTICES = 3


def conformal_sphere_map(V: Real, F: Triangles) -> Real:
    """Map a closed triangle mesh of genus 0 conformally onto the unit sphere.

    Parameters
    ----------
    V
        Vertices, shape [n, 3].
    F
        Triangles, counterclockwise seen from outside, shape [m, 3].

    Returns
    -------
    NDArray[np.float64]
        A unit vector for each vertex, shape [n, 3]. No triangle is folded (see `certify`).

    Raises
    ------
    SphereMapError
        The map has folds.
    """
    V = np.asarray(V, dtype=np.float64)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        # a singular system gives NaN, which is not certified
        warnings.simplefilter("ignore", MatrixRankWarning)
        S = _repair_north(V, F, _harmonic_map(V, F))
    certificate = certify(F, S)
    if not certificate.valid:
        raise SphereMapError(
            f"the conformal sphere map folds {certificate.flipped} of {len(F)} triangles; it needs "
            f"well-shaped "
            'triangles and a compact shape; use method="progressive", which never folds'
        )
    return S


def _harmonic_map(V: Real, F: Triangles) -> Real:
    """Sphere map that is harmonic except at one triangle, which becomes the north pole's.

    It is the most regular triangle.
    """
    corners_of = V[F]
    opposite_sides = np.roll(corners_of, -2, axis=1) - np.roll(corners_of, -1, axis=1)
    sides = np.linalg.norm(opposite_sides, axis=2)
    cut = int(np.argmin(np.ptp(sides, axis=1) / np.sum(sides, axis=1)))
    # the cut triangle in the plane: its first side lies along the real axis
    a, b, c = V[F[cut]]
    base = np.linalg.norm(b - a)
    foot = (c - a) @ (b - a) / base
    height = np.sqrt((c - a) @ (c - a) - foot**2)
    corners = np.array([0, base, foot + 1j * height])
    # each triangle in a plane of its own: the sides from its first corner to the second and third
    u = V[F[:, 1]] - V[F[:, 0]]
    v = V[F[:, 2]] - V[F[:, 0]]
    length = np.linalg.norm(u, axis=1)
    unit = np.ones(len(F))
    e = length + 0j
    f = (np.einsum("ij,ij->i", u, v) + 1j * np.linalg.norm(np.cross(u, v), axis=1)) / length
    laplacian = _stiffness(e, f, unit, 0 * unit, unit, F, len(V))
    plane = _solve_dirichlet(laplacian, F[cut], corners)
    plane -= plane.mean()

    # scale the plane so that the triangles at the two poles come out alike
    south = _from_south(_to_sphere(plane))
    by_radius = np.argsort(np.sum(np.abs(plane[F]), axis=1), kind="stable")
    inner = by_radius[0] if by_radius[0] != cut else by_radius[1]
    ratio = _perimeter(south[F[inner]]) / _perimeter(plane[F[cut]])
    return _to_sphere(plane * np.sqrt(ratio))


def _repair_north(V: Real, F: Triangles, S: Real) -> Real:
    """Make the map conformal also near the north pole."""
    plane = _from_south(S)
    e = plane[F[:, 1]] - plane[F[:, 0]]
    f = plane[F[:, 2]] - plane[F[:, 0]]
    u = V[F[:, 1]] - V[F[:, 0]]
    v = V[F[:, 2]] - V[F[:, 0]]
    det = e.real * f.imag - e.imag * f.real
    dx = (u * f.imag[:, None] - v * e.imag[:, None]) / det[:, None]
    dy = (v * e.real[:, None] - u * f.real[:, None]) / det[:, None]
    # the metric of the mesh in the plane
    xx = np.einsum("ij,ij->i", dx, dx)
    xy = np.einsum("ij,ij->i", dx, dy)
    yy = np.einsum("ij,ij->i", dy, dy)
    # Beltrami coefficient of the map from the plane to the mesh
    beltrami = (xx - yy + 2j * xy) / (xx + yy + 2 * np.sqrt(np.maximum(xx * yy - xy * xy, 0)))
    rho = beltrami.real
    tau = beltrami.imag
    rest = 1 - rho * rho - tau * tau
    stiffness = _stiffness(
        e,
        f,
        ((rho - 1) ** 2 + tau * tau) / rest,
        -2 * tau / rest,
        ((rho + 1) ** 2 + tau * tau) / rest,
        F,
        len(V),
    )
    count = max(round(_SOUTHERN_SHARE * len(V)), _MIN_SOUTHERN_VERTICES)
    southern = np.argsort(S[:, 2], kind="stable")[:count]
    repaired = _solve_dirichlet(stiffness, southern, plane[southern])
    return _to_sphere(repaired) * [1, 1, -1]


def _stiffness(
    e: Complex, f: Complex, xx: Real, xy: Real, yy: Real, F: Triangles, vertex_count: int
) -> sparse.csr_matrix:
    """Stiffness matrix of div(A grad), with A = [xx xy; xy yy], on flat triangles.

    The sides e and f of a triangle begin at its corner 0.
    """
    area = 0.5 * np.abs(e.real * f.imag - e.imag * f.real)
    sides = np.stack([f - e, -f, e], axis=1)
    # a hat function's gradient is its opposite side turned by a quarter, over twice the area
    gx = sides.imag
    gy = -sides.real
    flux_x = xx[:, None] * gx + xy[:, None] * gy
    flux_y = xy[:, None] * gx + yy[:, None] * gy
    entries = (gx[:, :, None] * flux_x[:, None, :] + gy[:, :, None] * flux_y[:, None, :]) / (
        4 * area[:, None, None]
    )
    rows = np.repeat(F, 3, axis=1).ravel()
    columns = np.tile(F, 3).ravel()
    return sparse.csr_matrix((entries.ravel(), (rows, columns)), shape=(vertex_count, vertex_count))


def _solve_dirichlet(
    stiffness: sparse.csr_matrix, fixed: NDArray[np.integer], values: Complex
) -> Complex:
    """Solve stiffness z = 0 at the free vertices, with z = values at the fixed ones."""
    z = np.zeros(stiffness.shape[0], dtype=np.complex128)
    z[fixed] = values
    free = np.setdiff1d(np.arange(len(z)), fixed)
    if len(free):
        right = -(stiffness[free] @ z)
        parts = spsolve(
            stiffness[free][:, free].tocsc(), np.stack([right.real, right.imag], axis=1)
        )
        z[free] = parts[..., 0] + 1j * parts[..., 1]
    return z


def _to_sphere(z: Complex) -> Real:
    """Inverse stereographic projection that sends infinity to the north pole."""
    square = np.abs(z) ** 2
    return np.stack([2 * z.real, 2 * z.imag, square - 1], axis=1) / (1 + square)[:, None]


def _from_south(S: Real) -> Complex:
    """Stereographic projection from the south pole."""
    return np.asarray(S[:, 0] + 1j * S[:, 1], dtype=np.complex128) / (1 + S[:, 2])


def _perimeter(corners: Complex) -> float:
    return float(np.sum(np.abs(corners - np.roll(corners, 1))))
