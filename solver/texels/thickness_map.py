"""How thick the layer is between a surface and what lies inside it."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ..checked import Valid, checked, instance
from ..errors import AtlasError, RippleWarning
from ..mesh.mesh import Mesh
from ..mesh.volume import Volume
from .atlas import Atlas
from .smoothing import smoothed

# Over the longest extent: what lies so little above the surface is taken for touching it, and no layer is thinner.
_LEAST = 1e-4


def _are_bodies(value: object) -> bool:
    return isinstance(value, Mesh | Volume) or (
        isinstance(value, Sequence) and all(isinstance(each, Mesh | Volume) for each in value)
    )


def _are_limits(value: Any) -> bool:
    try:
        least, greatest = value
        return bool(0 <= least <= greatest)
    except (TypeError, ValueError):
        return False


_BODIES = Valid(_are_bodies, "a Mesh, a Volume, or several of them")
_LIMITS = Valid(_are_limits, "a least and a greatest thickness [m], 0 or greater")


@checked(AtlasError, atlas=instance(Atlas, ", as `build_atlas` makes it"), inside=_BODIES, limits=_LIMITS)
def thickness_map(
    atlas: Atlas, inside: Mesh | Volume | Sequence[Mesh | Volume], limits: tuple[float, float] = (0.0, np.inf)
) -> NDArray[np.float64]:
    """Way from each texel along the inward normal to what lies inside [m], [C, n, n], smoothed over a few texels.

    Parameters
    ----------
    atlas : Atlas
        Of the outer surface.
    inside : Mesh, Volume, or several
        In the frame of the atlas.
    limits : (float, float)
        Least and greatest thickness [m]: beyond them it counts as these.

    Warns
    -----
    RippleWarning
        Where rays miss what lies inside and there is no greatest limit: they get the greatest thickness of the others.
        Where it comes out through the surface and there is no least limit: the layer is as thin there as it can be.

    Raises
    ------
    AtlasError
        If no ray meets what lies inside, or an argument is invalid.
    MeshError
        For an invalid volume.
    """
    bodies = [inside] if isinstance(inside, Mesh | Volume) else list(inside)
    corners = np.concatenate([np.zeros((0, 3, 3)), *(_triangles(body) for body in bodies)])
    points, normals = atlas.positions.reshape(-1, 3), atlas.normals.reshape(-1, 3)
    size = float(np.ptp(points, axis=0).max())
    way, out = _cast(corners, points, -normals, size)
    met = np.isfinite(way)
    if not met.any():
        raise AtlasError(
            "what lies inside is met by no ray from the surface inwards; valid is a body within it, in the same frame "
            f"and in metres: the surface goes from {points.min(axis=0).round(4)} to {points.max(axis=0).round(4)}"
        )
    if out.any() and limits[0] == 0:
        _warn(f"what lies inside comes out of the surface at {out.mean():.1%} of the texels: no layer is left")
    way = np.clip(way, max(limits[0], _LEAST * size), limits[1])
    if np.isinf(way).any():
        greatest = float(way[met].max())
        _warn(f"{1 - met.mean():.1%} of the texels have nothing below them; they get the greatest: {greatest:.3g} m")
        way = np.where(met, way, greatest)
    return smoothed(atlas.texels.topology, way.reshape(atlas.areas.shape))


def _triangles(body: Mesh | Volume) -> NDArray[np.float64]:
    """Corners of a body's triangles [m], [m, 3, 3]."""
    V, F = body.surface() if isinstance(body, Volume) else (body.V, body.F)
    return V[F]


def _cast(
    corners: NDArray[np.float64], points: NDArray[np.float64], ways: NDArray[np.float64], size: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Distance from points along unit ways to triangles [m, 3, 3], infinite without; and where they begin inside.

    Embree finds the triangle in float32; the distance is that to its plane in float64.
    """
    middle = points.mean(axis=0)
    scene = EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray((corners - middle) / size, dtype=np.float32))
    starts = points - _LEAST * size * ways
    found = scene.run(((starts - middle) / size).astype(np.float32), ways.astype(np.float32), output=1)
    triangle = np.asarray(found["primID"])
    met = np.flatnonzero(triangle >= 0)
    a, b, c = (corners[triangle[met], k] for k in range(3))
    normal = np.cross(b - a, c - a)
    along = (normal * ways[met]).sum(axis=1)
    distance, out = np.full(len(points), np.inf), np.zeros(len(points), np.bool_)
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = ((a - points[met]) * normal).sum(axis=1) / along
    distance[met] = np.where(np.isfinite(exact), np.maximum(exact, 0.0), found["tfar"][met] * size)
    out[met] = along > 0  # the first that is met is the far side
    distance[out] = 0.0
    return distance, out


def _warn(message: str) -> None:
    warnings.warn(message, RippleWarning, stacklevel=3)
