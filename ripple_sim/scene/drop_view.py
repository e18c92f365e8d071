"""The camera of a default scene: a view that shows the target's front and where bodies land."""

from __future__ import annotations

import numbers
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.render.camera import Camera
from ripple_sim.solver.errors import is_finite, shown
from ripple_sim.solver.mesh.queries import RayScene

from .camera_entry import CameraEntry
from .standing import SIZE, sampled

# Azimuths of the views that have a name [degrees]. The front faces -y.
VIEWS = {"front": 90.0, "left": 0.0, "back": 270.0, "right": 180.0, "top": 90.0}

# Azimuths of the camera to choose from [degrees]: three-quarter views of the front and of the back,
# and straighter views of the front, in which long words are larger.
_AZIMUTHS = [125.0, 55.0, 145.0, 35.0, 215.0, 325.0, 235.0, 305.0]
_STRAIGHT_AZIMUTHS = [110.0, 70.0]

# A target that is lower than this share of its width lies, and is read from the front: its views
# are at most so far to the side [degrees].
_LYING_HEIGHT = 0.5
_MAX_SIDEWAYS = 35.0

# Elevation of the camera on a target that lies flat, on one that is as high as it is wide, or
# higher, and from the top [degrees].
_FLAT_ELEVATION = -50.0
_HIGH_ELEVATION = -26.0
_TOP_ELEVATION = -90.0

# Vertical field of view of the camera [degrees].
_FOVY = 28.0

# Rate at which the camera circles [degrees/s].
_ORBIT = 5.0

# Height and width of the frame that the target may fill.
_FILLED = (0.64, 0.8)

# How far the target is below the middle of the frame, over its height, for the falls above it.
_BELOW_MIDDLE = 0.06

# Width of a frame over its height.
_ASPECT = 16 / 9

# Points of the surface by which views are compared.
_VIEW_POINTS = 1500

# Least upward part of the normal of a surface on which bodies land.
_MIN_TOP_NORMAL = 0.5

# A head is round: the uppermost part of the target faces in so many directions at least, of the 26
# that are distinguished. The edge of a wall faces in 5.
_MIN_HEAD_DIRECTIONS = 8.0

# Share of the points that count as the uppermost part, and as the base.
_END_SHARE = 0.1

# Weights of a view's score; its variety and the logarithm of its area have weight 1.
_LANDING_WEIGHT = 3.0
_HEAD_WEIGHT = 3.0
_FRONT_WEIGHT = 0.6

# Straight views are chosen if their score is better by this: three-quarter views show depth.
_STRAIGHT_COST = 0.35

# Keeps divisions and logarithms finite.
_TINY = 1e-300

# Steps after which the fit of a view changes by less than a pixel.
_FITTING_STEPS = 8


class _Subject(NamedTuple):
    """The parts of a target that views are compared by.

    Attributes
    ----------
    scene : RayScene
        The surface, for rays.
    points, normals : float64 [k, 3]
        Spread over the surface [m], and unit normals.
    corners : float64 [l, 3]
        Vertices [m].
    is_landing : bool [k]
        Points on which bodies can land.
    bins : int64 [k]
        Number of each normal's direction, in boxes of 2/3.
    head : float64 [2]
        Direction of the head from the middle of the base, over the size; 0 if there is no head.
    closed : bool
        Whether only the outer side can be seen.
    """

    scene: RayScene
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    corners: NDArray[np.float64]
    is_landing: NDArray[np.bool_]
    bins: NDArray[np.int64]
    head: NDArray[np.float64]
    closed: bool


def drop_camera(
    V: NDArray[np.float64],
    F: NDArray[np.int64],
    closed: bool,
    duration: float,
    view: str | float | None = None,
    elevation: float | None = None,
    has_front: bool = False,
) -> tuple[CameraEntry, NDArray[np.float64]]:
    """Camera of a target that fills the frame, and its eye half-way of the orbit [m].

    Parameters
    ----------
    V, F
        The target: vertices [n, 3] [m] and triangles [m, 3].
    closed : bool
        Whether the target is closed.
    duration : float
        Of the orbit [s].
    view : str or float, optional
        One of `VIEWS`, or the azimuth half-way of the orbit [degrees]. By default the three-quarter
        view with the best `_score`.
    elevation : float, optional
        [degrees]; negative looks down. By default from -50 for a flat target to -26 for a high one.
    has_front : bool
        Whether the front, which faces -y, is known: then it is seen by default.

    Raises
    ------
    SceneError
        For an invalid view or elevation.
    """
    from_top = view == "top"
    azimuth = _azimuth(view)
    if elevation is None:
        elevation = _TOP_ELEVATION if from_top else _usual_elevation(V)
    elif not (is_finite(elevation) and -90 <= elevation <= 90):
        raise SceneError(
            "elevation must be a number from -90, straight down, to 90 degrees, got "
            f"{shown(elevation)}"
        )
    if azimuth is None:
        azimuth = _best_azimuth(V, F, closed, elevation, has_front)
    lookat, distance, eye = _fitted(V, azimuth, elevation)
    orbit = 0.0 if from_top else _ORBIT
    x, y, z = lookat.tolist()
    entry = CameraEntry(
        lookat=(x, y, z),
        distance=distance,
        azimuth=azimuth - orbit * duration / 2,
        elevation=float(elevation),
        fovy=_FOVY,
        orbit=orbit,
    )
    return entry, eye


def _azimuth(view: str | float | None) -> float | None:
    """Azimuth of a view [degrees], or None if it is to be chosen."""
    if view is None:
        return None
    if isinstance(view, str) and view in VIEWS:
        return VIEWS[view]
    if isinstance(view, numbers.Real) and is_finite(view):
        return float(view)
    raise SceneError(
        f"view must be {', '.join(VIEWS)}, or an azimuth in degrees, got {shown(view)}"
    )


def _best_azimuth(
    V: NDArray[np.float64],
    F: NDArray[np.int64],
    closed: bool,
    elevation: float,
    has_front: bool,
) -> float:
    """Azimuth of the view that shows most of a target [degrees]."""
    subject = _subject(V, F, closed)
    scores = {azimuth: _score(subject, V, azimuth, elevation) for azimuth in _AZIMUTHS}
    for azimuth in _STRAIGHT_AZIMUTHS:
        scores[azimuth] = _score(subject, V, azimuth, elevation) - _STRAIGHT_COST
    candidates = list(scores)
    if has_front:
        candidates = [azimuth for azimuth in scores if np.sin(np.radians(azimuth)) > 0]
    if _uprightness(V) < _LYING_HEIGHT:
        candidates = [
            azimuth for azimuth in scores if abs(azimuth - VIEWS["front"]) <= _MAX_SIDEWAYS
        ]
    return max(candidates, key=lambda azimuth: scores[azimuth])


def _uprightness(V: NDArray[np.float64]) -> float:
    """Height over width, 1 at most."""
    width, depth, height = np.ptp(V, axis=0)
    return float(min(height / max(width, depth), 1.0))


def _usual_elevation(V: NDArray[np.float64]) -> float:
    """Elevation of the camera [degrees], the steeper, the flatter the target."""
    return _FLAT_ELEVATION + (_HIGH_ELEVATION - _FLAT_ELEVATION) * _uprightness(V)


def _subject(V: NDArray[np.float64], F: NDArray[np.int64], closed: bool) -> _Subject:
    """The parts of a target that views are compared by."""
    scene = RayScene(V, F)
    points, normals = sampled(V, F, _VIEW_POINTS)
    upward = normals[:, 2] if closed else np.abs(normals[:, 2])
    up = np.zeros_like(points)
    up[:, 2] = SIZE
    # the numbers of the box along the three axes, -2 to 2, as digits in base 5
    bins = np.rint(1.5 * normals).astype(int) @ [25, 5, 1] + 62
    # rays begin a little above the surface, and go beyond the top of the target
    is_open_above = scene.distances(points + 1e-3 * up, 3 * up) > 1
    return _Subject(
        scene=scene,
        points=points,
        normals=normals,
        corners=V[:: -(-len(V) // _VIEW_POINTS)],
        is_landing=(upward > _MIN_TOP_NORMAL) & is_open_above,
        bins=bins,
        head=_head(points, bins),
        closed=closed,
    )


def _head(points: NDArray[np.float64], bins: NDArray[np.int64]) -> NDArray[np.float64]:
    """Direction of the head from the middle of the base, over the size [2]; 0 if there is no head.

    The head is the uppermost part, if it is round.
    """
    is_upper = points[:, 2] >= np.quantile(points[:, 2], 1 - _END_SHARE)
    is_base = points[:, 2] <= np.quantile(points[:, 2], _END_SHARE)
    if np.exp(_entropy(np.bincount(bins[is_upper]))) < _MIN_HEAD_DIRECTIONS:
        return np.zeros(2)
    lean = points[is_upper].mean(axis=0) - points[is_base].mean(axis=0)
    return np.asarray(lean[:2] / SIZE)


def _entropy(weights: NDArray) -> float:
    """Entropy of shares in proportion to weights."""
    shares = weights / max(float(weights.sum()), _TINY)
    return -float((shares * np.log(np.maximum(shares, _TINY))).sum())


def _score(subject: _Subject, V: NDArray[np.float64], azimuth: float, elevation: float) -> float:
    """How much a view shows of a target.

    The score counts

    - the share that is visible of the places where bodies land;
    - the front, from which letters read;
    - the side to which the head leans;
    - the area in the picture;
    - the details: many visible vertices, and normals in many directions. The variety of directions
      is the entropy of those that are visible (as in Page et al. 2003, "Shape analysis algorithm
      based on information theory").
    """
    lookat, distance, eye = _fitted(V, azimuth, elevation)
    rays = eye - subject.points
    cosine = np.einsum("ij,ij->i", rays, subject.normals) / np.linalg.norm(rays, axis=1)
    outer_normals = subject.normals * np.sign(cosine)[:, None]
    ray_starts = subject.points + 1e-4 * SIZE * outer_normals
    is_clear = subject.scene.distances(ray_starts, rays) > 1
    is_seen = is_clear & ((cosine > 0) | (not subject.closed))
    # area that each point stands for in the picture
    area = np.where(is_seen, np.abs(cosine), 0.0) / distance**2
    variety = _entropy(np.bincount(subject.bins, weights=area))
    landing = is_seen[subject.is_landing].mean() if subject.is_landing.any() else 0.0
    towards_camera = (eye - lookat)[:2] / distance
    front = -towards_camera[1]
    corner_rays = eye - subject.corners
    corner_starts = subject.corners + 1e-3 * corner_rays
    detail = (subject.scene.distances(corner_starts, corner_rays) > 1).mean()
    return float(
        variety
        + _LANDING_WEIGHT * landing
        + _HEAD_WEIGHT * subject.head @ towards_camera
        + _FRONT_WEIGHT * front
        + np.log(max(area.sum() * detail, _TINY))
    )


def _fitted(
    V: NDArray[np.float64], azimuth: float, elevation: float
) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """View in which a target fills its share of the frame.

    Returns the point to look at [m], the distance from there [m], and the eye [m].
    """
    lookat = (V.min(axis=0) + V.max(axis=0)) / 2
    distance = 3 * SIZE
    tangent = np.tan(np.radians(_FOVY) / 2)
    spans = 2 * tangent * np.array([_ASPECT * _FILLED[1], _FILLED[0]])
    for _ in range(_FITTING_STEPS):
        pose = Camera(tuple(lookat.tolist()), distance, azimuth, elevation, _FOVY).pose()
        local = (V - pose.position) @ pose.rotation
        in_picture = local[:, :2] / -local[:, 2:]
        low = in_picture.min(axis=0)
        high = in_picture.max(axis=0)
        middle = (low + high) / 2 + [0.0, 2 * tangent * _BELOW_MIDDLE]
        lookat = lookat + pose.rotation[:, :2] @ middle * distance
        distance *= float(((high - low) / spans).max())
    return lookat, distance, pose.position
