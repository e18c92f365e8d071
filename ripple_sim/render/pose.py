"""Poses: where a camera is, and how points of the world lie in its frame."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import warn_caller

from .projection import parallel_depth, perspective, perspective_depth, view_along

# Clip planes of a camera that says nothing of them, in its distances.
_NEAR = 0.02


_FAR = 200.0


_ROUND_OFF = 1e-4  # of MuJoCo's frustums, which have single precision, relative


_SLACK = 0.99  # of the distance of the first thing, where the near plane may be


@dataclass(frozen=True)
class Pose:
    """A camera in the world.

    Attributes
    ----------
    position : array, shape [3]
        [m].
    rotation : array, shape [3, 3]
        Its columns are right, up and backwards: a camera looks along -z, as in OpenGL and MuJoCo.
    distance : float
        Of the focus, the point that the camera is about [m].
    fovy : float
        Vertical field of view [degrees]; of an orthographic camera the height of what it sees [m].
    lens : tuple of float
        The eye may be off the camera's position, at a point of the lens (to the right, up) [m].
        Points of the plane in focus then stay where they are in the frame.
    focal_distance : float
        Of the plane in focus [m].
    orthographic : bool
        Whether rays are parallel, in place of a perspective view.
    centre : tuple of float
        Where the middle of the frame is off the camera's axis (to the right, up): a metre in front
        of the eye, or with parallel rays anywhere [m].
    half_width : float, optional
        Half the width of what is seen, there [m]; by default pixels are square.
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
        """Where the ray through the middle of the frame starts [m], shape [3]; in perspective all rays do."""
        offset = np.add(self.lens, self.centre) if self.orthographic else np.asarray(self.lens)
        return self.position + self.rotation[:, :2] @ offset

    @property
    def shear(self) -> NDArray[np.float64]:
        """How far the ray through the middle of the frame goes right and up, a metre in front of the eye."""
        blur = -np.divide(self.lens, self.focal_distance)
        return blur if self.orthographic else blur + self.centre

    @property
    def focus(self) -> NDArray[np.float64]:
        """Point that the camera is about [m], shape [3]."""
        return self.position - self.distance * self.rotation[:, 2]

    @property
    def clip_planes(self) -> tuple[float, float]:
        """Distances of the near and the far plane [m]."""
        return self.clip or (_NEAR * self.distance, _FAR * self.distance)

    def planes_about(self, balls: NDArray[np.float64]) -> tuple[float, float]:
        """The clip planes, the near one moved on to the first of some balls [m].

        Depths are the more precise the farther away it is, and MuJoCo's is very near by default.
        """
        near, far = self.clip_planes
        if self.clip is None or not len(balls):
            return near, far
        depth = (self.eye - balls[:, :3]) @ self.rotation[:, 2]
        in_front = depth + balls[:, 3] > 0
        first = float((depth - balls[:, 3])[in_front].min(initial=far))
        return float(np.clip(_SLACK * first, near, max(near, far / 2))), far

    @property
    def half_height(self) -> float:
        """Half the height of what is seen: a metre in front of the eye, or with parallel rays anywhere [m]."""
        return self.fovy / 2 if self.orthographic else float(np.tan(np.radians(self.fovy) / 2))

    def half_sizes(self, aspect: float) -> NDArray[np.float64]:
        """Half the width and height of what is seen, likewise [m]; `aspect` is the frame's width over its height."""
        half_width = aspect * self.half_height if self.half_width is None else self.half_width
        return np.array([half_width, self.half_height])

    def is_plain(self, aspect: float) -> bool:
        """Whether it is in perspective, looks along the middle of its frame, and has square pixels."""
        centred = np.allclose(self.centre, 0.0, atol=_ROUND_OFF * self.half_height)
        return not self.orthographic and centred and self.has_square_pixels(aspect)

    def has_square_pixels(self, aspect: float) -> bool:
        """Whether pixels of a frame of an aspect, width over height, are as wide as high."""
        return bool(
            np.isclose(self.half_sizes(aspect)[0], aspect * self.half_height, rtol=_ROUND_OFF)
        )

    def in_perspective(self, aspect: float, shown_by: str) -> Pose:
        """For what can show no other: itself in plain perspective, where what is in focus has the same height.

        It warns once that `shown_by` shows it otherwise than it is.
        """
        if self.is_plain(aspect):
            return self
        warn_caller(
            f"{shown_by} shows the camera in perspective, centred and with square pixels, which it "
            f"is not; "
            "RippleRenderer and ripple-sim render show it as it is"
        )
        half_height = self.half_height / self.distance if self.orthographic else self.half_height
        fovy = float(np.degrees(2 * np.arctan(half_height)))
        return dataclasses.replace(
            self, fovy=fovy, orthographic=False, centre=(0.0, 0.0), half_width=None
        )

    def pose(self) -> Pose:
        """Itself: a pose is a viewpoint."""
        return self

    def projection(
        self, aspect: float, planes: tuple[float, float] | None = None
    ) -> NDArray[np.float64]:
        """Eye to clip coordinates, shape [4, 4]; see `view_matrix`.

        The `planes` are the clip planes by default.
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
        """Points [..., 3] of the world as the eye has them: to the right and up [..., 2], and distances [...] [m].

        The former are off the ray through the middle of the frame, the latter along the camera's
        axis.
        """
        local = (points - self.eye) @ self.rotation
        depth = -local[..., 2]
        return local[..., :2] - depth[..., None] * self.shear, depth

    def ways(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """From where the rays to points of the world start to the points, both [..., 3] [m]."""
        if not self.orthographic:
            return points - self.eye
        _, depth = self.local(points)
        return depth[..., None] * (self.rotation @ [*self.shear, -1.0])

    def pixels(
        self, points: NDArray[np.float64], size: tuple[int, int]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where points of the world are in a frame of a size (width, height).

        Returns
        -------
        array, shape [..., 2]
            Columns and rows, from the frame's upper left corner [pixels]; nonsense behind a camera
            in perspective.
        array, shape [...]
            Distances along the camera's axis [m].
        """
        beside, depth = self.local(points)
        if not self.orthographic:
            beside = beside / np.maximum(depth, 1e-12)[..., None]
        scale = np.array(size) / (2 * self.half_sizes(size[0] / size[1]))
        return np.array(size) / 2 + scale * beside * [1, -1], depth

    def points(self, depth: NDArray[np.floating]) -> NDArray[np.float64]:
        """Points of the world [height, width, 3] that the pixels of a frame show at distances along the axis [m]."""
        height, width = depth.shape
        half_width, half_height = self.half_sizes(width / height)
        right = half_width * (2 * (np.arange(width) + 0.5) - width) / width
        up = half_height * (1 - 2 * (np.arange(height) + 0.5) / height)
        offset = np.stack([*np.meshgrid(right, up), np.zeros((height, width))], axis=-1)
        along = np.array([*self.shear, -1.0])
        depth = depth[..., None].astype(np.float64)
        local = offset + depth * along if self.orthographic else depth * (offset + along)
        return self.eye + local @ self.rotation.T

    def pixel_height(self, depth: float, height: int) -> float:
        """Height of a pixel of a frame [m] at a distance along the axis [m]; `height` is the frame's [pixels]."""
        return 2 * self.half_height * (1.0 if self.orthographic else depth) / height


def view_matrix(pose: Pose) -> NDArray[np.float64]:
    """World to eye coordinates, shape [4, 4]."""
    return view_along(pose.rotation.T, pose.rotation.T @ pose.eye)
