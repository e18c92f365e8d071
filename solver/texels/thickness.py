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
from .smoothing import smoothed

# Lengths are shares of the longest extent of the surface.

# Points closer to a texel than this are details that do not count: the edges of a box, for
# instance.
_DETAIL = 0.04

# Radius of a medial ball, at least: a ball that touches two points a detail apart has half the
# detail as its radius.
MIN_MEDIAL_RADIUS = _DETAIL / 2

# Radius of a medial ball, at most.
_MAX_MEDIAL_RADIUS = 0.55

# Number of points among which medial balls are sought, at most, roughly.
_MAX_POINTS = 8_000

# Rounds in which balls shrink, at most: by then every ball has stopped.
_MAX_SHRINKING_ROUNDS = 12

# Share of its radius by which a ball must shrink to go on.
_MIN_SHRINKAGE = 1e-3

# Depth below the surface at which a ray to the other side starts.
_RAY_START = 1e-3

# Half thickness of an object, at least and at most.
_MIN_HALF_THICKNESS = 0.01
_MAX_HALF_THICKNESS = 0.55

# Thickness of a layer, at least. A body that lies so little above the surface counts as touching
# the surface.
_MIN_LAYER_THICKNESS = 1e-4


@kept_with
def medial_radius(atlas: Atlas) -> NDArray[np.float32]:
    """Radius of the largest ball that touches a texel and holds no other part of the surface [m].

    [C, n, n]; the lesser one of the balls inside and outside. A point that moves along its normal
    by less than this radius is still closer to its start than to any other place, so that no two
    points meet. Radii are found by shrinking balls (Ma, Bae and Choi 2012, "3D medial axis point
    approximation using nearest neighbors and the normal field"). They are `MIN_MEDIAL_RADIUS` to
    0.55, as shares of the longest extent of the surface.
    """
    size = float(np.ptp(atlas.mesh.V, axis=0).max())
    stride = int(np.ceil(np.sqrt(atlas.areas.size / _MAX_POINTS)))
    points = atlas.positions[:, ::stride, ::stride].reshape(-1, 3)
    normals = atlas.normals[:, ::stride, ::stride].reshape(-1, 3)
    tree = cKDTree(points)
    radius_inside = _shrunk(tree, points, -normals, size)
    radius_outside = _shrunk(tree, points, normals, size)
    radius = np.minimum(radius_inside, radius_outside)
    _, nearest = tree.query(atlas.positions.reshape(-1, 3))
    curvature = 1 / radius[nearest].reshape(atlas.areas.shape)
    return (1 / smoothed(atlas.texels.topology, curvature)).astype(np.float32)


def _shrunk(tree: cKDTree, points: Floats, normals: Floats, size: float) -> Floats:
    """Radii of the balls on the side of the normals, [k].

    Each ball shrinks until no point lies in it.
    """
    radius = np.full(len(points), _MAX_MEDIAL_RADIUS * size)
    active = np.arange(len(points))
    for _ in range(_MAX_SHRINKING_ROUNDS):
        center = points[active] + normals[active] * radius[active, None]
        distance, nearest = tree.query(center)
        away = points[nearest] - points[active]
        squared = (away**2).sum(axis=1)
        depth = (away * normals[active]).sum(axis=1)
        is_inside = distance < (1 - _MIN_SHRINKAGE) * radius[active]
        is_detail = squared <= (_DETAIL * size) ** 2
        within = is_inside & ~is_detail & (depth > 0)
        active = active[within]
        if not len(active):
            break
        # the ball that touches the surface at the texel and passes through the point
        radius[active] = np.minimum(radius[active], squared[within] / (2 * depth[within]))
    return radius


def half_thickness(atlas: Atlas) -> NDArray[np.float64]:
    """Half the way from each texel to the other side of the object [m], [C, n, n].

    It is the radius of a ball or a tube. The way is along the inward normal (Shapira, Shamir and
    Cohen-Or 2008, "Consistent mesh partitioning and skeletonisation using the shape diameter
    function", with one ray a texel instead of a cone), and smoothed. Without another side it is
    about half of the longest extent.
    """
    radius = half_thickness_at(
        atlas.mesh, atlas.positions.reshape(-1, 3), atlas.normals.reshape(-1, 3)
    )
    return 1 / smoothed(atlas.texels.topology, 1 / radius.reshape(atlas.areas.shape))


def half_thickness_at(mesh: Mesh, points: Floats, normals: Floats) -> Floats:
    """Half the way from points of the surface [k, 3] [m] to the other side [m], [k].

    Normals [k, 3] are outward.
    """
    V = mesh.V
    F = mesh.F
    middle = V.mean(axis=0)
    size = float(np.ptp(V, axis=0).max())
    scene = RayScene(((V - middle) / size)[F])
    starts = (points - middle) / size - _RAY_START * normals
    distance = scene.distances(starts, -normals)
    half = (distance.astype(np.float64) + _RAY_START) / 2
    return size * np.clip(half, _MIN_HALF_THICKNESS, _MAX_HALF_THICKNESS)


def _are_limits(value: Any) -> bool:
    """Whether a value is a least and a greatest thickness."""
    try:
        least, greatest = value
        return bool(0 <= least <= greatest)
    except (TypeError, ValueError):
        return False


def _are_bodies(value: Any) -> bool:
    """Whether a value is a body, or a sequence of bodies."""
    bodies = value if isinstance(value, Sequence) else [value]
    return all(isinstance(body, Mesh | Volume) for body in bodies)


@checked(
    AtlasError,
    atlas=instance(Atlas, ", as `build_atlas` makes it"),
    inside=Valid(_are_bodies, "a Mesh, a Volume, or several of them"),
    limits=Valid(_are_limits, "a least and a greatest thickness [m], 0 or greater"),
)
def thickness_map(
    atlas: Atlas,
    inside: Mesh | Volume | Sequence[Mesh | Volume],
    limits: tuple[float, float] = (0.0, np.inf),
) -> NDArray[np.float64]:
    """Way from each texel along the inward normal to the body inside [m], [C, n, n].

    It is smoothed over a few texels.

    Parameters
    ----------
    atlas : Atlas
        Of the outer surface.
    inside : Mesh, Volume, or several
        In the frame of the atlas.
    limits : (float, float)
        Least and greatest thickness [m]; a thickness beyond them counts as the limit.

    Warns
    -----
    RippleWarning
        Where rays miss the body inside and there is no greatest limit: their texels get the
        greatest thickness of the others. Where the body comes out through the surface and there is
        no least limit: the layer is as thin there as it can be.

    Raises
    ------
    AtlasError
        If no ray meets the body inside, or an argument is invalid.
    MeshError
        For an invalid volume.
    """
    bodies = [inside] if isinstance(inside, Mesh | Volume) else inside
    surfaces = [body.surface() if isinstance(body, Volume) else (body.V, body.F) for body in bodies]
    corners = np.concatenate([np.zeros((0, 3, 3)), *(V[F] for V, F in surfaces)])
    points = atlas.positions.reshape(-1, 3)
    normals = atlas.normals.reshape(-1, 3)
    size = float(np.ptp(points, axis=0).max())
    way, sticks_out = _cast(corners, points, -normals, size)
    met = np.isfinite(way)
    if not met.any():
        raise AtlasError(
            "no ray from the surface inwards meets the inner body: it must lie within the "
            "surface, in the same frame and in metres; the surface goes from "
            f"{points.min(axis=0).round(4)} to {points.max(axis=0).round(4)}"
        )
    if sticks_out.any() and limits[0] == 0:
        message = (
            f"the inner body reaches out of the surface at {sticks_out.mean():.1%} of the texels, "
            "so no layer is left: it must lie within the surface"
        )
        warn_caller(message)
    way = np.clip(way, max(limits[0], _MIN_LAYER_THICKNESS * size), limits[1])
    if np.isinf(way).any():
        greatest = float(way[met].max())
        message = (
            f"{1 - met.mean():.1%} of the texels have no inner body below them; they get the "
            f"greatest thickness, {greatest:.3g} m"
        )
        warn_caller(message)
        way = np.where(met, way, greatest)
    return smoothed(atlas.texels.topology, way.reshape(atlas.areas.shape))


def _cast(corners: Floats, points: Floats, ways: Floats, size: float) -> tuple[Floats, Bools]:
    """Distances from points [k, 3] [m] along unit ways [k, 3] to triangles [m, 3, 3].

    Returns the distances [k] [m], and which rays start inside of the body [k]. The distance is
    infinite where a ray meets no triangle, and 0 where it starts inside. Embree finds the triangle
    in float32; the distance to its plane is in float64.
    """
    middle = points.mean(axis=0)
    starts = points - _MIN_LAYER_THICKNESS * size * ways
    triangle, near, _, _ = RayScene((corners - middle) / size).cast((starts - middle) / size, ways)
    met = np.flatnonzero(triangle >= 0)
    a = corners[triangle[met], 0]
    b = corners[triangle[met], 1]
    c = corners[triangle[met], 2]
    normal = np.cross(b - a, c - a)
    along = (normal * ways[met]).sum(axis=1)
    distance = np.full(len(points), np.inf)
    starts_inside = np.zeros(len(points), np.bool_)
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = ((a - points[met]) * normal).sum(axis=1) / along
    distance[met] = np.where(np.isfinite(exact), np.maximum(exact, 0.0), near[met] * size)
    starts_inside[met] = along > 0  # the ray meets the far side first
    distance[starts_inside] = 0.0
    return distance, starts_inside
