"""`UsdWriter`: a run as a stage of Universal Scene Description.

The camera has its motion, lens and shutter. The frames of a long run may lie in files of their own,
see `Chunks`.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils

from ripple_sim.capture.scene_camera import focal_distance
from ripple_sim.coupling.geoms import target_name
from ripple_sim.coupling.ids import is_geom
from ripple_sim.coupling.ripples import Impulse
from ripple_sim.encode.replace import MARK

from .moving_mesh import Displaced, MovingMesh
from .source import Source, Writer
from .usd_chunks import Chunks, made_here, succeed
from .usd_looks import Lamps, Materials, child, define_mesh, extent, place, placing, vectors
from .visuals import solids, target_finish

__all__ = ["UsdWriter", "made_here"]

# Height of the camera's film [m], as of 35 mm film. Angle of view and depth of field do not depend
# on it.
_FILM_HEIGHT = 0.024
_TENTHS = 10.0  # USD has lengths within a camera in tenths of a unit

# Clipping planes, in distances of the camera from what it looks at.
_NEAR_PLANE = 0.01
_FAR_PLANE = 1000.0

# Time of the files in a .usdz, 1980-01-02 [s], so that the same run gives the same bytes.
_FILE_TIME = 315_619_200

_FRAMES_IN_MEMORY = 8  # which are then appended to the file


class UsdWriter(Writer):
    """Writes a run to a .usdc, .usda or .usdz file, in metres, with z up, a time code a frame."""

    def __init__(self, source: Source, path: Path) -> None:
        self._source = source
        self._path = path
        # text and packages are made of a binary file, which alone can grow
        self._binary = (
            path if path.suffix.lower() == ".usdc" else path.with_name(f"{path.stem}.whole.usdc")
        )
        self._images = path.with_name(f"{path.stem}.textures")
        layer = Sdf.Layer.CreateNew(str(self._binary))
        layer.comment = MARK
        self._stage = stage = Usd.Stage.Open(layer)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
        stage.SetTimeCodesPerSecond(source.fps)
        stage.SetFramesPerSecond(source.fps)
        world = UsdGeom.Xform.Define(stage, "/World")
        stage.SetDefaultPrim(world.GetPrim())
        self._materials = Materials(
            stage, world.GetPath().AppendChild("Looks"), source.model, self._images
        )
        self._camera = UsdGeom.Camera.Define(stage, world.GetPath().AppendChild("camera"))
        self._camera.CreateShutterOpenAttr(0.0)
        self._camera.CreateShutterCloseAttr(source.camera.shutter / 360)
        self._lamps = Lamps(stage, world.GetPath().AppendChild("lights"), source)
        bodies = UsdGeom.Scope.Define(stage, "/World/bodies").GetPath()
        self._bodies = [
            UsdGeom.Xform.Define(
                stage, child(stage, bodies, source.model.body(i).name or f"body_{i}")
            )
            for i in range(source.model.nbody)
        ]
        for solid in solids(source.model, set(source.ripples.geom_ids.values())):
            body = self._bodies[solid.body].GetPath()
            mesh = define_mesh(
                stage, child(stage, body, solid.name), solid.F, solid.uv, open_surface=False
            )
            place(mesh, solid.position, solid.quaternion)
            mesh.CreatePointsAttr(vectors(solid.points))
            mesh.CreateNormalsAttr(vectors(solid.normals))
            mesh.CreateExtentAttr(extent(solid.points))
            self._materials.bind(mesh, solid.finish)
        self._before: dict[str, NDArray[np.float32]] = {}
        self._surfaces = {name: self._define_surface(name) for name in source.ripples}
        self._last = 0
        self._chunks = Chunks(stage, world.GetPath(), source) if source.chunk else None

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add a frame, unless it is there from an earlier run."""
        chunks = self._chunks
        if number == 0:
            self._begin(data)
        if chunks is None:
            self._sample(number, data, self._shapes(data))
        else:
            chunks.check_state(number, data)
            if number >= chunks.stored - 1:  # the one before tells of motion
                shapes = self._shapes(data)
            if number >= chunks.stored:
                chunks.write(lambda: self._sample(number, data, shapes))
        self._last = number
        if number % _FRAMES_IN_MEMORY == _FRAMES_IN_MEMORY - 1:
            succeed(self._stage.GetRootLayer().Save)

    def finish(self) -> None:
        """Complete the file."""
        self._stage.SetStartTimeCode(0)
        self._stage.SetEndTimeCode(self._last)
        if self._chunks is not None:
            self._chunks.finish(self._path.with_name(f"{self._path.stem}.chunks"), self._last)
        succeed(self._stage.GetRootLayer().Save)
        match self._path.suffix.lower():
            case ".usda":
                succeed(self._stage.GetRootLayer().Export, str(self._path))
            case ".usdz":
                for packed in (self._binary, *self._images.glob("*")):
                    os.utime(packed, (_FILE_TIME, _FILE_TIME))
                succeed(
                    UsdUtils.CreateNewUsdzPackage, Sdf.AssetPath(str(self._binary)), str(self._path)
                )
                shutil.rmtree(self._images, ignore_errors=True)  # they are in the package now
        if self._binary != self._path:
            self._binary.unlink()

    def close(self) -> str:
        """Drop unsaved frames; return a note about kept files of an unfinished run, if any."""
        return "" if self._chunks is None else self._chunks.close()

    def _begin(self, data: mujoco.MjData) -> None:
        """Define everything that stays as it is at the first frame."""
        pose = self._source.pose(data)
        width, height = self._source.size
        half_width, half_height = pose.half_sizes(width / height)
        # the aperture of an orthographic camera is the width of its view; it has no lens
        focal = 1.0 if pose.orthographic else _FILM_HEIGHT / 2 / half_height
        lens = 0.0 if pose.orthographic else self._source.camera.aperture
        near, far = pose.clip or (_NEAR_PLANE * pose.distance, _FAR_PLANE * pose.distance)
        placing(self._camera)
        self._camera.CreateProjectionAttr("orthographic" if pose.orthographic else "perspective")
        self._camera.CreateHorizontalApertureAttr(_TENTHS * 2 * focal * half_width)
        self._camera.CreateVerticalApertureAttr(_TENTHS * 2 * focal * half_height)
        self._camera.CreateHorizontalApertureOffsetAttr(_TENTHS * focal * pose.centre[0])
        self._camera.CreateVerticalApertureOffsetAttr(_TENTHS * focal * pose.centre[1])
        self._camera.CreateFocalLengthAttr(_TENTHS * focal)
        self._camera.CreateFStopAttr(focal / lens if lens else 0.0)  # 0: all is sharp
        self._camera.CreateClippingRangeAttr(Gf.Vec2f(near, far))
        self._camera.CreateFocusDistanceAttr()
        self._lamps.begin(data)
        for body, prim in enumerate(self._bodies):
            if _stands(self._source.model, body):
                place(prim, data.xpos[body], data.xquat[body], 0)
            else:
                placing(prim)

    def _shapes(self, data: mujoco.MjData) -> dict[str, Displaced]:
        """The surfaces of a frame; call it frame by frame."""
        source = self._source
        shapes = {}
        for name, (surface, _) in self._surfaces.items():
            waves = source.ripples[name]
            V = source.ripples.vertices(name, data)
            shape = surface.shape(waves.height, waves.velocity / np.float32(source.slow_motion), V)
            if V is not None:
                # waves and motion together, since the frame before
                before = self._before.get(name, shape.points)
                shape = shape._replace(velocities=(shape.points - before) * np.float32(source.fps))
                self._before[name] = shape.points
            shapes[name] = shape
        return shapes

    def _sample(self, time: int, data: mujoco.MjData, shapes: dict[str, Displaced]) -> None:
        """Set the time samples of a frame."""
        for body, prim in enumerate(self._bodies):
            if not _stands(self._source.model, body):
                place(prim, data.xpos[body], data.xquat[body], time)
        source = self._source
        pose = self._source.pose(data)
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(pose.rotation).ravel())
        place(self._camera, pose.position, quaternion, time)
        focus = focal_distance(source.model, data, source.camera, pose)
        self._camera.GetFocusDistanceAttr().Set(float(focus), Usd.TimeCode(time))
        self._lamps.write(data, time)
        for name, (_, mesh) in self._surfaces.items():
            shape = shapes[name]
            mesh.GetPointsAttr().Set(vectors(shape.points), time)
            mesh.GetNormalsAttr().Set(vectors(shape.normals), time)
            mesh.GetVelocitiesAttr().Set(vectors(shape.velocities), time)
            mesh.GetExtentAttr().Set(extent(shape.points), time)

    def _define_surface(self, name: str) -> tuple[MovingMesh, UsdGeom.Mesh]:
        source = self._source
        model = self._source.model
        geom = source.ripples.geom_ids[name]
        surface = source.mesh(name)
        atlas = source.ripples[name].rest
        soft = not is_geom(geom, model)
        finish, uv = target_finish(source, name, surface)
        uv = surface.uv if uv is None else uv
        body = self._bodies[0 if soft else int(model.geom_bodyid[geom])]
        path = child(self._stage, body.GetPath(), target_name(model, geom))
        mesh = define_mesh(self._stage, path, surface.F, uv, open_surface=not atlas.mesh.closed)
        if not soft:
            place(mesh, model.geom_pos[geom], model.geom_quat[geom])
        mesh.CreatePointsAttr()
        mesh.CreateNormalsAttr()
        mesh.CreateVelocitiesAttr()
        mesh.CreateExtentAttr()
        self._materials.bind(mesh, finish)
        return surface, mesh


def _stands(model: mujoco.MjModel, body: int) -> bool:
    """Whether a body is fixed to the world."""
    return (
        int(model.body_weldid[body]) == 0 and int(model.body_mocapid[model.body_rootid[body]]) < 0
    )
