"""Poses: where a camera is, and how points of the world lie in its frame."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import warn_caller

from .projection import parallel_depth, perspective, perspective_depth, view_along

# Distances of the clip planes of a camera without any [distances of the focus].
_DEFAULT_NEAR = 0.02
_DEFAULT_FAR = 200.0

# Relative round-off of MuJoCo's frustums, which have single precision.
_FRUSTUM_ROUND_OFF = 1e-4

# The near plane is moved no farther than this share of the distance of the first ball in front.
_NEAR_SHARE_OF_FIRST_BALL = 0.99

# Least depth by which points are divided in perspective [m]; points behind the camera have less.
_MIN_DEPTH = 1e-12


@dataclass(frozen=True)
class Pose:
    """A camera in the world.

    Attributes
    ----------
    position : array, shape [3]
        Position in the world [m].
    rotation : array, shape [3, 3]
        Its columns are right, up and backwards: a camera looks along -z, as in OpenGL and MuJoCo.
    distance : float
        Distance of the focus, the point that the camera looks at [m].
    fovy : float
        Vertical field of view [degrees]. Of an orthographic camera: height of the visible part of
        the world [m].
    lens : tuple of float
        Offset of the eye from the camera's position, to a point of the lens (to the right, up) [m].
        Points of the plane in focus stay at the same place of the frame.
    focal_distance : float
        Distance of the plane in focus [m].
    orthographic : bool
        Whether the view is orthographic instead of perspective.
    centre : tuple of float
        Offset of the frame's middle from the camera's axis (to the right, up) [m]. In perspective
        it is measured one metre in front of the eye; with parallel rays it is the same everywhere.
    half_width : float, optional
        Half the width of the frame, measured in the same way [m]; by default pixels are square.
    clip : tuple of float, optional
        Distances of the near and the far plane [m]; by default they follow the distance of the
        focus.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    distance: float
    fovy: float = 45.0
    lens: tuple[float, float] = (0.0, 0.0)
    focal_distance: float = np.inf
    orthographic: bool = False
    centre: tuple[float, float] = (0.0, 0.0)
    half_width: float | None = None
    clip: tuple[float, float] | None = None

    @property
    def eye(self) -> NDArray[np.float64]:
        """Start of the ray through the middle of the frame [m], shape [3].

        In perspective all rays start there.
        """
        offset = np.add(self.lens, self.centre) if self.orthographic else np.asarray(self.lens)
        return self.position + self.rotation[:, :2] @ offset

    @property
    def shear(self) -> NDArray[np.float64]:
        """Slope of the ray through the frame's middle: to the right and up, per metre ahead."""
        lens_shear = -np.divide(self.lens, self.focal_distance)
        return lens_shear if self.orthographic else lens_shear + self.centre

    @property
    def focus(self) -> NDArray[np.float64]:
        """Point that the camera looks at [m], shape [3]."""
        return self.position - self.distance * self.rotation[:, 2]

    @property
    def clip_planes(self) -> tuple[float, float]:
        """Distances of the near and the far plane [m]."""
        return self.clip or (_DEFAULT_NEAR * self.distance, _DEFAULT_FAR * self.distance)

    def planes_about(self, balls: NDArray[np.float64]) -> tuple[float, float]:
        """The clip planes, with the near plane moved forward to the first of some balls [m].

        Depths are more precise with a farther near plane, and MuJoCo's default is very near.
        """
        near, far = self.clip_planes
        if self.clip is None or not len(balls):
            return near, far
        radii = balls[:, 3]
        depth = (self.eye - balls[:, :3]) @ self.rotation[:, 2]
        in_front = depth + radii > 0
        first = float((depth - radii)[in_front].min(initial=far))
        farthest_near = max(near, far / 2)
        near = float(np.clip(_NEAR_SHARE_OF_FIRST_BALL * first, near, farthest_near))
        return near, far

    @property
    def half_height(self) -> float:
        """Half the height of the frame [m].

        In perspective it is measured one metre in front of the eye.
        """
        if self.orthographic:
            return self.fovy / 2
        return float(np.tan(np.radians(self.fovy) / 2))

    def half_sizes(self, aspect: float) -> NDArray[np.float64]:
        """Half the width and half the height of the frame, measured like `half_height` [m].

        `aspect` is the frame's width over its height.
        """
        half_width = aspect * self.half_height if self.half_width is None else self.half_width
        return np.array([half_width, self.half_height])

    def is_plain(self, aspect: float) -> bool:
        """Whether the view is in perspective, centred on its axis, with square pixels."""
        centred = np.allclose(self.centre, 0.0, atol=_FRUSTUM_ROUND_OFF * self.half_height)
        return not self.orthographic and centred and self.has_square_pixels(aspect)

    def has_square_pixels(self, aspect: float) -> bool:
        """Whether pixels are as wide as high; `aspect` is the frame's width over its height."""
        half_width, _ = self.half_sizes(aspect)
        square = np.isclose(half_width, aspect * self.half_height, rtol=_FRUSTUM_ROUND_OFF)
        return bool(square)

    def in_perspective(self, aspect: float, shown_by: str) -> Pose:
        """Return a pose in plain perspective, for viewers that can show no other.

        The plane in focus has the same height. A warning says once that `shown_by` changes the
        view.
        """
        if self.is_plain(aspect):
            return self
        warn_caller(
            f"{shown_by} shows the camera in perspective, centred and with square pixels, which it "
            "is not; RippleRenderer and ripple-sim render show it as it is"
        )
        half_height = self.half_height / self.distance if self.orthographic else self.half_height
        fovy = float(np.degrees(2 * np.arctan(half_height)))
        return dataclasses.replace(
            self, fovy=fovy, orthographic=False, centre=(0.0, 0.0), half_width=None
        )

    def pose(self) -> Pose:
        """Return the pose itself, so that a pose is a viewpoint."""
        return self

    def projection(
        self, aspect: float, planes: tuple[float, float] | None = None
    ) -> NDArray[np.float64]:
        """Matrix from eye to clip coordinates, shape [4, 4]; see `view_matrix`.

        `planes` are the distances of the near and the far plane [m], by default `clip_planes`.
        """
        near, far = planes or self.clip_planes
        if not self.orthographic and self.half_width is None:
            return perspective(self.fovy, aspect, near, far, self.shear)
        scale = 1 / self.half_sizes(aspect)
        projection = np.zeros((4, 4))
        projection[[0, 1], [0, 1]] = scale
        projection[:2, 2] = scale * self.shear
        projection[2:, 2:] = (
            parallel_depth(near, far) if self.orthographic else perspective_depth(near, far)
        )
        return projection

    def local(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Points of the world [..., 3] in the eye's frame.

        Returns
        -------
        array, shape [..., 2]
            Offsets to the right and up from the ray through the middle of the frame [m].
        array, shape [...]
            Distances along the camera's axis [m].
        """
        local = (points - self.eye) @ self.rotation
        depth = -local[..., 2]
        beside = local[..., :2] - depth[..., None] * self.shear
        return beside, depth

    def ways(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vectors from the starts of rays to the points [..., 3] of the world that they hit [m]."""
        if not self.orthographic:
            return points - self.eye
        _, depth = self.local(points)
        return depth[..., None] * (self.rotation @ [*self.shear, -1.0])

    def pixels(
        self, points: NDArray[np.float64], size: tuple[int, int]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Pixels that show points of the world, in a frame of a size (width, height).

        Returns
        -------
        array, shape [..., 2]
            Columns and rows, from the frame's upper left corner [pixels]. Points behind a camera in
            perspective have meaningless ones.
        array, shape [...]
            Distances along the camera's axis [m].
        """
        beside, depth = self.local(points)
        if not self.orthographic:
            beside = beside / np.maximum(depth, _MIN_DEPTH)[..., None]
        scale = np.array(size) / (2 * self.half_sizes(size[0] / size[1]))
        return np.array(size) / 2 + scale * beside * [1, -1], depth

    def points(self, depth: NDArray[np.floating]) -> NDArray[np.float64]:
        """Points of the world that the pixels of a frame show, shape [height, width, 3] [m].

        `depth` [height, width] has the distances of the points along the camera's axis [m].
        """
        height, width = depth.shape
        half_width, half_height = self.half_sizes(width / height)
        right = half_width * (2 * (np.arange(width) + 0.5) - width) / width
        up = half_height * (1 - 2 * (np.arange(height) + 0.5) / height)
        right_of_pixels, up_of_pixels = np.meshgrid(right, up)
        offset = np.stack([right_of_pixels, up_of_pixels, np.zeros((height, width))], axis=-1)
        along = np.array([*self.shear, -1.0])
        depth = depth[..., None].astype(np.float64)
        local = offset + depth * along if self.orthographic else depth * (offset + along)
        return self.eye + local @ self.rotation.T

    def pixel_height(self, depth: float, height: int) -> float:
        """Height of a pixel [m] at a distance along the camera's axis [m].

        `height` is the frame's [pixels].
        """
        distance = 1.0 if self.orthographic else depth
        return 2 * self.half_height * distance / height


def view_matrix(pose: Pose) -> NDArray[np.float64]:
    """Matrix from world to eye coordinates, shape [4, 4]."""
    return view_along(pose.rotation.T, pose.rotation.T @ pose.eye)
