"""How thick an object is at each texel of its surface, by rays and by the balls that fit into it.

The radii of medial balls say how far a surface may move along its normals before it meets itself;
rays, how far it is to the other side, or to what lies inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..cache import kept_with
from ..errors import AtlasError, Valid, checked, instance, warn_caller
from ..kernel import Bools, Floats
from ..mesh.mesh import Mesh
from ..mesh.queries import RayScene
from ..mesh.volume import Volume
from .atlas import Atlas
from .texel_mesh import smoothed

# Details closer to a texel than this share of the surface's size do not count: the edges of a box,
# for instance.
_DETAIL = 0.04

# No radius is less than this share of the size: a ball that touches two points a detail apart has
# half its diameter.
LEAST = _DETAIL / 2
_MOST_RADIUS = 0.55

_POINTS = 8_000  # among which the balls are sought
_ROUNDS = 12  # by then every ball has stopped to shrink
_TOLERANCE = 1e-3

# Over the longest extent: a ray starts so far below the surface, no radius is less than the second
# or more than the third.
_START = 1e-3
_LEAST = 0.01
_MOST = 0.55

# Over the longest extent: what lies so little above the surface is taken for touching it, and no
# layer is thinner.
_LEAST_THICKNESS = 1e-4
_BODIES = Valid(
    lambda value: all(
        isinstance(each, Mesh | Volume)
        for each in (value if isinstance(value, Sequence) else [value])
    ),
    "a Mesh, a Volume, or several of them",
)


@kept_with
def medial_radius(atlas: Atlas) -> NDArray[np.float32]:
    """Radius of the largest ball that touches the surface at a texel and holds no other part of it [m], [C, n, n].

    The lesser one of the balls inside and outside. A point that is moved along its normal by less
    than that is still closer to where it came from than to any other place, so that no two of them
    meet. Found by shrinking balls (Ma, Bae and Choi 2012, "3D medial axis point approximation using
    nearest neighbors and the normal field"), at `LEAST` to 0.55 of the surface's longest extent.
    """
    size = float(np.ptp(atlas.mesh.V, axis=0).max())
    stride = int(np.ceil(np.sqrt(atlas.areas.size / _POINTS)))
    points, normals = (
        field[:, ::stride, ::stride].reshape(-1, 3) for field in (atlas.positions, atlas.normals)
    )
    tree = cKDTree(points)
    inside, outside = (_shrunk(tree, points, side * normals, size) for side in (-1.0, 1.0))
    _, nearest = tree.query(atlas.positions.reshape(-1, 3))
    curvature = 1 / np.minimum(inside, outside)[nearest].reshape(atlas.areas.shape)
    return (1 / smoothed(atlas.texels.topology, curvature)).astype(np.float32)


def _shrunk(tree: cKDTree, points: Floats, normals: Floats, size: float) -> Floats:
    """Radii of the balls on the side of the normals, [k]: each shrinks until no point lies in it."""
    radius = np.full(len(points), _MOST_RADIUS * size)
    active = np.arange(len(points))
    for _ in range(_ROUNDS):
        center = points[active] + normals[active] * radius[active, None]
        distance, nearest = tree.query(center)
        away = points[nearest] - points[active]
        squared = (away**2).sum(axis=1)
        depth = (away * normals[active]).sum(axis=1)
        within = (
            (distance < (1 - _TOLERANCE) * radius[active])
            & (squared > (_DETAIL * size) ** 2)
            & (depth > 0)
        )
        active = active[within]
        if not len(active):
            break
        # the ball that touches the surface at the texel and passes through the point
        radius[active] = np.minimum(radius[active], squared[within] / (2 * depth[within]))
    return radius


def half_thickness(atlas: Atlas) -> NDArray[np.float64]:
    """Half the way from each texel to the other side of the object [m], [C, n, n]: the radius of a ball, of a tube.

    Along the inward normal (Shapira, Shamir and Cohen-Or 2008, "Consistent mesh partitioning and
    skeletonisation using the shape diameter function", with one ray a texel instead of a cone), and
    smoothed. Without another side it is about half of the longest extent.
    """
    radius = half_thickness_at(
        atlas.mesh, atlas.positions.reshape(-1, 3), atlas.normals.reshape(-1, 3)
    )
    return 1 / smoothed(atlas.texels.topology, 1 / radius.reshape(atlas.areas.shape))


def half_thickness_at(mesh: Mesh, points: Floats, normals: Floats) -> Floats:
    """Half the way from points of the surface [m], [k, 3], to the other side [m], [k]; normals [k, 3] are outward."""
    V = mesh.V
    F = mesh.F
    middle = V.mean(axis=0)
    size = float(np.ptp(V, axis=0).max())
    distance = RayScene(((V - middle) / size)[F]).distances(
        (points - middle) / size - _START * normals, -normals
    )
    return size * np.clip((distance.astype(np.float64) + _START) / 2, _LEAST, _MOST)


def _are_limits(value: Any) -> bool:
    try:
        least, greatest = value
        return bool(0 <= least <= greatest)
    except (TypeError, ValueError):
        return False


_LIMITS = Valid(_are_limits, "a least and a greatest thickness [m], 0 or greater")


@checked(
    AtlasError, atlas=instance(Atlas, ", as `build_atlas` makes it"), inside=_BODIES, limits=_LIMITS
)
def thickness_map(
    atlas: Atlas,
    inside: Mesh | Volume | Sequence[Mesh | Volume],
    limits: tuple[float, float] = (0.0, np.inf),
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
        Where rays miss what lies inside and there is no greatest limit: they get the greatest
        thickness of the others. Where it comes out through the surface and there is no least limit:
        the layer is as thin there as it can be.

    Raises
    ------
    AtlasError
        If no ray meets what lies inside, or an argument is invalid.
    MeshError
        For an invalid volume.
    """
    bodies = [inside] if isinstance(inside, Mesh | Volume) else inside
    surfaces = [body.surface() if isinstance(body, Volume) else (body.V, body.F) for body in bodies]
    corners = np.concatenate([np.zeros((0, 3, 3)), *(V[F] for V, F in surfaces)])
    points = atlas.positions.reshape(-1, 3)
    normals = atlas.normals.reshape(-1, 3)
    size = float(np.ptp(points, axis=0).max())
    way, out = _cast(corners, points, -normals, size)
    met = np.isfinite(way)
    if not met.any():
        raise AtlasError(
            "what lies inside is met by no ray from the surface inwards; valid is a body within "
            "it, in the same frame "
            f"and in metres: the surface goes from {points.min(axis=0).round(4)} to "
            f"{points.max(axis=0).round(4)}"
        )
    if out.any() and limits[0] == 0:
        message = (
            f"what lies inside comes out of the surface at {out.mean():.1%} of the texels: "
            f"no layer is left"
        )
        warn_caller(message)
    way = np.clip(way, max(limits[0], _LEAST_THICKNESS * size), limits[1])
    if np.isinf(way).any():
        greatest = float(way[met].max())
        message = (
            f"{1 - met.mean():.1%} of the texels have nothing below them; they get the "
            f"greatest: {greatest:.3g} m"
        )
        warn_caller(message)
        way = np.where(met, way, greatest)
    return smoothed(atlas.texels.topology, way.reshape(atlas.areas.shape))


def _cast(corners: Floats, points: Floats, ways: Floats, size: float) -> tuple[Floats, Bools]:
    """Distance from points along unit ways to triangles [m, 3, 3], infinite without; and where they begin inside.

    Embree finds the triangle in float32; the distance is that to its plane in float64.
    """
    middle = points.mean(axis=0)
    starts = points - _LEAST_THICKNESS * size * ways
    triangle, near, _, _ = RayScene((corners - middle) / size).cast((starts - middle) / size, ways)
    met = np.flatnonzero(triangle >= 0)
    a, b, c = (corners[triangle[met], k] for k in range(3))
    normal = np.cross(b - a, c - a)
    along = (normal * ways[met]).sum(axis=1)
    distance = np.full(len(points), np.inf)
    out = np.zeros(len(points), np.bool_)
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = ((a - points[met]) * normal).sum(axis=1) / along
    distance[met] = np.where(np.isfinite(exact), np.maximum(exact, 0.0), near[met] * size)
    out[met] = along > 0  # the first that is met is the far side
    distance[out] = 0.0
    return distance, out
