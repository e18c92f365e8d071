"""Texture coordinates into the atlas, beside the object's own: a face of the cube and a place in it at every corner.

A triangle that crosses an edge of the cube is cut along it. One coordinate pair a corner cannot do instead: equiangular
coordinates continue smoothly beyond an edge, but there they leave the neighbour's grid (its rows are not the
continuation of this face's rows), and at 90 degrees from the face's middle they end, so that a long triangle has none.
Cut pieces lie in one face each, with coordinates in [0, 1] that any cube-map texture or array of six layers can be
sampled at: with the ring of neighbours round each layer (`cubemap.padded_indices`) the result is continuous everywhere.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numba
import numpy as np
from numpy.typing import NDArray

from .convention import FACE_NORMALS, FACE_U, FACE_V

if TYPE_CHECKING:
    from ripple_sim.solver.texels.atlas import Atlas

# Relative to a triangle: what hangs over an edge by less counts as within, and smaller pieces are left out.
_ROUND_OFF = 1e-12
# The four planes through the cube's centre that bound each face's share of space; inwards is positive.
_SIDES = np.stack(
    [FACE_NORMALS - FACE_U, FACE_NORMALS + FACE_U, FACE_NORMALS - FACE_V, FACE_NORMALS + FACE_V], axis=1
).astype(np.float64)


@dataclasses.dataclass(frozen=True, eq=False)
class TextureCoordinates:
    """The triangles of a mesh, cut where they cross an edge of the cube, with coordinates into the atlas.

    Attributes
    ----------
    triangle : int64 [piece_count]
        Triangle of the mesh of which each piece is a part, in ascending order. Most are not cut: one piece, the whole.
    barycentrics : float64 [piece_count, 3, 3]
        Where in that triangle the piece's three corners lie, in the winding of the mesh.
    face : int64 [piece_count]
        Face of the atlas, the layer of a texture array.
    uv : float64 [piece_count, 3, 2]
        Place in the face at each corner, 0 to 1: (column + 1/2) / N and (row + 1/2) / N, whatever the resolution N.
        In a layer padded by one texel all round it is at (1 + N uv) / (N + 2).
    """

    triangle: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    face: NDArray[np.int64]
    uv: NDArray[np.float64]

    def carry(self, corner_values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at the pieces' corners of what is linear in each triangle of the mesh.

        Parameters
        ----------
        corner_values : [face_count, 3, ...]
            Values at the corners of the mesh's triangles, such as `mesh.V[mesh.F]` or `mesh.corner_uv`.

        Returns
        -------
        [piece_count, 3, ...]
        """
        return np.einsum("pij,pj...->pi...", self.barycentrics, np.asarray(corner_values)[self.triangle])


def texture_coordinates(atlas: Atlas) -> TextureCoordinates:
    """Coordinates into the atlas at every corner of every triangle of its mesh.

    They are exact at the corners. In between, linear interpolation deviates from the sphere map's own place by a share
    of about 0.1 s^2 of a face, where s is the angle that the triangle spans on the sphere: refine a mesh whose
    triangles span many texels before it is textured.
    """
    corners = atlas.sphere[atlas.mesh.F]
    face = _face_of(corners.sum(axis=1))
    inside = (np.einsum("mki,msi->mks", corners, _SIDES[face]) >= -_ROUND_OFF).all(axis=(1, 2))
    whole, crossing = np.flatnonzero(inside), np.flatnonzero(~inside)
    owner, piece_face, pieces = _cut(corners[crossing], _SIDES)
    triangle = np.concatenate([whole, crossing[owner]])
    order = np.argsort(triangle, kind="stable")
    triangle = triangle[order]
    face = np.concatenate([face[whole], piece_face])[order]
    barycentrics = np.concatenate([np.tile(np.eye(3), (len(whole), 1, 1)), pieces])[order]
    directions = np.einsum("pij,pjk->pik", barycentrics, corners[triangle])
    return TextureCoordinates(triangle, barycentrics, face, _place(directions, face))


def _face_of(directions: NDArray[np.float64]) -> NDArray[np.int64]:
    axis = np.argmax(np.abs(directions), axis=1)
    return 2 * axis + (np.take_along_axis(directions, axis[:, None], axis=1)[:, 0] < 0)


def _place(directions: NDArray[np.float64], face: NDArray[np.int64]) -> NDArray[np.float64]:
    """Equiangular place in a face, 0 to 1, of directions [k, 3, 3] that belong to it."""
    depth = np.einsum("pki,pi->pk", directions, FACE_NORMALS[face])
    sides = np.einsum("pki,pij->pkj", directions, np.stack([FACE_U, FACE_V], axis=-1)[face])
    return np.clip(0.5 + np.arctan(sides / depth[..., None]) * (2 / np.pi), 0.0, 1.0)


@numba.njit(cache=True)
def _cut(corners, sides):
    """Cut triangles [k, 3, 3] into their parts in each face: owner, face, and barycentrics [pieces, 3, 3]."""
    # a triangle that is cut by four planes has seven corners at most, which make five pieces
    owner = np.empty(30 * len(corners), np.int64)
    face = np.empty(30 * len(corners), np.int64)
    pieces = np.empty((30 * len(corners), 3, 3))
    polygon, clipped = np.empty((8, 3)), np.empty((8, 3))
    count = 0
    for t in range(len(corners)):
        for f in range(6):
            for i in range(3):
                for j in range(3):
                    polygon[i, j] = 1.0 if i == j else 0.0
            size = 3
            for s in range(4):
                size = _clip(polygon, size, corners[t], sides[f, s], clipped)
                polygon, clipped = clipped, polygon
            for k in range(2, size):
                a, b, c = polygon[0], polygon[k - 1], polygon[k]
                area = (
                    a[0] * (b[1] * c[2] - b[2] * c[1])
                    + a[1] * (b[2] * c[0] - b[0] * c[2])
                    + a[2] * (b[0] * c[1] - b[1] * c[0])
                )
                if area > _ROUND_OFF:
                    owner[count] = t
                    face[count] = f
                    for j in range(3):
                        pieces[count, 0, j] = a[j]
                        pieces[count, 1, j] = b[j]
                        pieces[count, 2, j] = c[j]
                    count += 1
    return owner[:count], face[:count], pieces[:count]


@numba.njit(cache=True)
def _clip(polygon, size, corners, plane, clipped):
    """Keep the part of a convex polygon on the inner side of a plane (Sutherland and Hodgman 1974); return its size."""
    count = 0
    previous = polygon[size - 1]
    p = _distance(previous, corners, plane)
    for i in range(size):
        q = _distance(polygon[i], corners, plane)
        if (p >= 0) != (q >= 0):
            for j in range(3):
                # the same to the last bit from whichever side it is looked at
                clipped[count, j] = (p * polygon[i, j] - q * previous[j]) / (p - q)
            count += 1
        if q >= 0:
            for j in range(3):
                clipped[count, j] = polygon[i, j]
            count += 1
        previous, p = polygon[i], q
    return count


@numba.njit(cache=True)
def _distance(weights, corners, plane):
    total = 0.0
    for i in range(3):
        total += weights[i] * (corners[i, 0] * plane[0] + corners[i, 1] * plane[1] + corners[i, 2] * plane[2])
    return total
