"""The camera of a run, with its motion, lens and shutter."""

from __future__ import annotations

import mujoco
import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

from .meshes import place, placing
from .source import Source

_SENSOR = 0.024  # height [m], that of 35 mm film; the angle of view and the depth of field do not depend on it
_TENTHS = 10.0  # USD gives lengths in a camera in tenths of a unit
_NEAR, _FAR = 0.01, 1000.0  # of the camera's distance


class MovingCamera:
    """A camera in a stage, with the motion of the source's.

    Parameters
    ----------
    stage : Usd.Stage
    path : Sdf.Path
    source : Source
    """

    def __init__(self, stage: Usd.Stage, path: Sdf.Path, source: Source) -> None:
        self._source = source
        self._camera = UsdGeom.Camera.Define(stage, path)
        width, height = source.size
        self._camera.CreateVerticalApertureAttr(_TENTHS * _SENSOR)
        self._camera.CreateHorizontalApertureAttr(_TENTHS * _SENSOR * width / height)
        self._camera.CreateShutterOpenAttr(0.0)
        self._camera.CreateShutterCloseAttr(source.camera.shutter / 360)

    def begin(self, data: mujoco.MjData) -> None:
        """Define what stays as it is at the first frame."""
        pose, _ = self._source.pose(data)
        focal, aperture = _SENSOR / 2 / np.tan(np.radians(pose.fovy) / 2), self._source.camera.aperture
        placing(self._camera)
        self._camera.CreateFocalLengthAttr(_TENTHS * focal)
        self._camera.CreateFStopAttr(focal / aperture if aperture else 0.0)  # 0: all is sharp
        self._camera.CreateClippingRangeAttr(Gf.Vec2f(_NEAR * pose.distance, _FAR * pose.distance))
        self._camera.CreateFocusDistanceAttr()

    def write(self, data: mujoco.MjData, time: float) -> None:
        """Add a frame."""
        pose, focus = self._source.pose(data)
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(pose.rotation).ravel())
        place(self._camera, pose.position, quaternion, time)
        self._camera.GetFocusDistanceAttr().Set(float(focus), Usd.TimeCode(time))
