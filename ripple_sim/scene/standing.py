"""How a mesh stands on the floor of a default scene: its size, its place, and which axis is up."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Mesh

# Axes of a file that may point up.
UP_AXES = ("y", "z")

# Endings of formats that state which axis points up: in glTF 2.0 (section 3.4) it is y, and assimp
# turns FBX and COLLADA files so that y points up.
_Y_UP_ENDINGS = (".glb", ".gltf", ".fbx", ".dae")

# Endings of formats in which models face +z (glTF 2.0, section 3.4).
_FRONT_ENDINGS = (".glb", ".gltf")

# The target's longest edge of its bounding box [m].
SIZE = 1.0

# Largest height over the floor at which a vertex counts as a foot, over the size.
_FOOT_HEIGHT = 0.02

# An open mesh in one part lies down if it is thinner than this share of its longest extent, and
# than the second share of its middle extent: a pipe has no thin side.
_SHEET_THICKNESS = 1 / 3
_MAX_SHEET_SHARE = 0.6

# Largest thickness over size of a mesh that counts as flat.
_FLAT_THICKNESS = 1e-6

# Height of a flat mesh over the floor, so that waves have room below [m].
_FLAT_CLEARANCE = 0.25

# Number of points on a surface whose mean is its middle.
_MIDDLE_POINTS = 1500

# Order of a file's axes and their signs after the turn by which an axis points up.
_TURNS = {
    "x": ([1, 2, 0], [1.0, 1.0, 1.0]),
    "y": ([0, 2, 1], [1.0, -1.0, 1.0]),
    "z": ([0, 1, 2], [1.0, 1.0, 1.0]),
}


class Standing(NamedTuple):
    """A mesh as it stands.

    Attributes
    ----------
    V : float64 [n, 3]
        Vertices, scaled, over the origin, on z = 0 [m].
    note : str
        For the user, if the mesh does not stand on the usual axis; otherwise empty.
    """

    V: NDArray[np.float64]
    note: str = ""


def usual_up(path: str | Path) -> str:
    """Axis that usually points up in files of this format: "z" for STL, else "y"."""
    return "z" if Path(path).suffix.lower() == ".stl" else "y"


def states_up(path: str | Path) -> bool:
    """Whether files of this format state that the usual axis points up."""
    return Path(path).suffix.lower() in _Y_UP_ENDINGS


def states_front(path: str | Path) -> bool:
    """Whether models in files of this format face +z, where y points up."""
    return Path(path).suffix.lower() in _FRONT_ENDINGS


def stand(mesh: Mesh, up: str | None, usual: str, stated: bool = False) -> Standing:
    """Scale a mesh to the size, and stand it on the floor.

    Parameters
    ----------
    mesh : Mesh
    up : str, optional
        Axis that points up. By default a sheet lies down. Otherwise it is the usual axis, unless
        the mesh falls over on that one and stands on the other.
    usual : str
        Axis that usually points up in such files.
    stated : bool
        Whether the file states that this axis points up: then the mesh stands on no other.
    """
    if up is not None:
        return Standing(_upright(mesh, up))
    thin = _thin_axis(mesh)
    if thin is not None:
        note = f'it is a thin sheet and lies down; --up {usual}, in Python up="{usual}", stands it'
        return Standing(_upright(mesh, thin), "" if thin == usual else note)
    if stated:
        return Standing(_upright(mesh, usual))
    standing = {axis: _upright(mesh, axis) for axis in UP_AXES}
    falls = {axis: _falls(V, mesh.F) for axis, V in standing.items()}
    # an axis on which the mesh stands, and of two such axes the usual one
    best = min(UP_AXES, key=lambda axis: (falls[axis], axis != usual))
    return Standing(standing[best])


def sampled(
    V: NDArray[np.float64], F: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points spread evenly over a surface, [count, 3], and its unit normals there, [count, 3]."""
    a, b, c = np.moveaxis(V[F], 1, 0)
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    rng = np.random.default_rng(0)
    triangles = rng.choice(len(F), count, p=areas / areas.sum())
    weights = rng.dirichlet((1.0, 1.0, 1.0), count)
    points = np.einsum("ij,ijk->ik", weights, V[F[triangles]])
    return points, normals[triangles] / areas[triangles, None]


def _thin_axis(mesh: Mesh) -> str | None:
    """Axis across which a mesh is a sheet: without thickness, or open, in one part, and thin."""
    extents = np.ptp(mesh.V, axis=0)
    thin, middle, longest = np.sort(extents)
    is_flat = thin <= _FLAT_THICKNESS * longest
    is_thin = thin < _SHEET_THICKNESS * longest and thin < _MAX_SHEET_SHARE * middle
    is_sheet = not mesh.closed and mesh.component_count == 1 and is_thin
    return "xyz"[int(extents.argmin())] if is_flat or is_sheet else None


def _falls(V: NDArray[np.float64], F: NDArray[np.int64]) -> bool:
    """Whether a mesh that stands on the floor falls over.

    It stands if the middle of its surface is above the area between its feet: seen from the middle,
    no gap between their directions is half a turn or more.
    """
    points, _ = sampled(V, F, _MIDDLE_POINTS)
    middle = points.mean(axis=0)[:2]
    feet = V[V[:, 2] <= _FOOT_HEIGHT * SIZE][:, :2] - middle
    angles = np.sort(np.arctan2(feet[:, 1], feet[:, 0]))
    gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
    return not gaps.max() < np.pi


def _upright(mesh: Mesh, up: str) -> NDArray[np.float64]:
    """Vertices scaled, turned upright, and standing on z = 0 over the origin [m].

    A flat mesh hovers above the floor.
    """
    order, signs = _TURNS[up]
    V = mesh.V[:, order] * signs
    V = V * (SIZE / np.ptp(V, axis=0).max())
    low = V.min(axis=0)
    high = V.max(axis=0)
    is_flat = high[2] - low[2] <= _FLAT_THICKNESS * SIZE
    clearance = _FLAT_CLEARANCE if is_flat else 0.0
    return V - [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2] - clearance]
