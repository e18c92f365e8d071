"""`Stage`: a session's targets, bodies, floor, shadows and lights in a PyVista plotter.

Soft round shadows on the floor show how high bodies and targets are.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from ripple_sim.capture.scene_camera import viewpoint
from ripple_sim.coupling.ids import GeomId, is_geom
from ripple_sim.coupling.soft import target_pose
from ripple_sim.export.moving_mesh import Displaced
from ripple_sim.overlay.scales import round_up
from ripple_sim.render.passes.floor import find_floor
from ripple_sim.render.surfaces.surface import target_color
from ripple_sim.render.visuals.shapes import shape_of, sizes
from ripple_sim.render.visuals.visual import geom_visual, visible_geoms

from .session import Session

_PLANE = mujoco.mjtGeom.mjGEOM_PLANE
BACKGROUND = (0.74, 0.77, 0.81)

# Least vertical part of a floor's normal: shadows fall straight down, so they need a level floor.
_MIN_LEVEL_COSINE = 0.999

# rings and sides of the disc that is drawn for an infinite floor
_FADE_RINGS = 24
_FADE_SIDES = 72

HEIGHT = "height [mm]"
_PER_METRE = 1000.0

# The range of the colours is one of these times a power of ten, so that it changes rarely.
_STEPS = (1.0, 2.0, 5.0)

# segments of a round geom per right angle
_GEOM_SEGMENTS = 8

_SHADING: dict[str, Any] = {
    "ambient": 0.32,
    "diffuse": 0.75,
    "specular": 0.3,
    "specular_power": 30.0,
}

# Darkness of the shadow of a geom that touches the floor, from 0 to 1.
_MAX_DARKNESS = 0.42

# Height above the floor from which a geom casts no shadow, in radii of its bounding ball.
_MAX_SHADOW_HEIGHT = 6.0

# Radius of a shadow, in radii of the geom's bounding ball.
_SHADOW_WIDTH = 1.15

# Height of a shadow's disc above the floor, in radii of the geom's bounding ball.
_SHADOW_BIAS = 0.01

# rings and sides of a shadow's disc
_SHADOW_RINGS = 8
_SHADOW_SIDES = 32

# Bodies farther away than this, in distances of the first camera, wait for their turn and are
# hidden.
_REACH = 4.0


def is_endless(model: mujoco.MjModel, geom: GeomId, reach: float) -> bool:
    """Whether a geom is a plane that is infinite or extends beyond the view."""
    size = model.geom_size[geom, :2]
    return model.geom_type[geom] == _PLANE and bool(((size <= 0) | (size > reach / 2)).all())


def add_floor(
    plotter: pv.Plotter, middle: NDArray[np.float64], radius: float, rgba: NDArray[np.float64]
) -> pv.Actor:
    """Add a plane as an unlit disc around a middle [m].

    The disc is large, and light is slow in software OpenGL.
    """
    disc = pv.Disc(inner=0.0, outer=radius, normal=(0, 0, 1), r_res=_FADE_RINGS, c_res=_FADE_SIDES)
    away = np.linalg.norm(disc.points, axis=1) / radius
    share = np.clip((away - 0.1) / 0.7, 0, 1)[:, None]
    share = share * share * (3 - 2 * share)
    colors = (1 - share) * rgba[:3] + share * np.array(BACKGROUND)
    disc.points[:, :2] += middle[:2]
    disc.point_data["color"] = np.rint(255 * colors).astype(np.uint8)
    return plotter.add_mesh(disc, scalars="color", rgb=True, lighting=False, reset_camera=False)


class BodyActors:
    """The geoms of a model that do not ripple, moved by MuJoCo's poses.

    Those farther than `reach` from the middle of the view [m] wait for their turn, and are hidden.
    """

    def __init__(
        self, plotter: pv.Plotter, session: Session, middle: NDArray[np.float64], reach: float
    ) -> None:
        self._session = session
        self._middle = middle
        self._reach = reach
        model = session.simulation.model
        self._actors = {}
        for geom in visible_geoms(model):
            if geom in session.simulation.ripples.geom_ids.values():
                continue
            rgba = geom_visual(model, geom).rgba
            if is_endless(model, geom, reach):
                position, rotation = target_pose(session.simulation.data, geom)
                self._actors[geom] = add_floor(plotter, (middle - position) @ rotation, reach, rgba)
                continue
            mesh = geom_mesh(model, geom)
            if mesh is not None:
                self._actors[geom] = plotter.add_mesh(
                    mesh,
                    color=rgba[:3].tolist(),
                    opacity=float(rgba[3]),
                    interpolation="Phong",
                    reset_camera=False,
                    **_SHADING,
                )
        self.update()

    @property
    def solid(self) -> list[GeomId]:
        """Visible geoms except planes."""
        kinds = self._session.simulation.model.geom_type
        return [geom for geom in self._actors if kinds[geom] != _PLANE]

    def update(self) -> None:
        """Take the poses from the session."""
        parked = self._session.parked
        solid = set(self.solid)
        for geom, actor in self._actors.items():
            position, rotation = target_pose(self._session.simulation.data, geom)
            _place(actor, position, rotation)
            far = geom in solid and np.linalg.norm(position - self._middle) > self._reach
            actor.SetVisibility(not (far or geom in parked))


class SkinActor:
    """A rippling surface of one sRGB colour.

    Points, normals and heights are written into the arrays that VTK reads.
    """

    def __init__(
        self,
        plotter: pv.Plotter,
        F: NDArray[np.int64],
        shape: Displaced,
        color: NDArray[np.float64],
    ) -> None:
        self._mesh = mesh = pv.PolyData.from_regular_faces(shape.points, F)
        mesh.point_data.active_normals = shape.normals
        mesh.point_data.set_array(_PER_METRE * shape.height, HEIGHT)
        mesh.set_active_scalars(HEIGHT)
        self.actor = plotter.add_mesh(
            mesh,
            scalars=HEIGHT,
            cmap="coolwarm",
            clim=(-1.0, 1.0),
            color=color.tolist(),
            show_scalar_bar=False,
            copy_mesh=False,
            interpolation="Phong",
            **_SHADING,
        )
        self.actor.prop.specular_color = "white"

    def update(self, shape: Displaced, pose: tuple[NDArray, NDArray], limit: float | None) -> None:
        """Take the present points, normals and heights, and the pose in the world.

        Heights are shown as colours from minus to plus a limit [m]; with None, the surface is in
        its own colour.
        """
        mesh = self._mesh
        mapper = self.actor.mapper
        mesh.points[:] = shape.points
        data = mesh.GetPointData()
        _overwrite(data.GetNormals(), shape.normals)
        _overwrite(data.GetArray(HEIGHT), _PER_METRE * shape.height)
        mesh.GetPoints().Modified()
        _place(self.actor, *pose)
        mapper.scalar_visibility = limit is not None
        if limit is not None:
            mapper.scalar_range = (-_PER_METRE * limit, _PER_METRE * limit)


def geom_mesh(model: mujoco.MjModel, geom: GeomId) -> pv.PolyData | None:
    """Surface of a geom in its frame [m], with normals; None for types that cannot be drawn."""
    visual = geom_visual(model, geom)
    named_shape = shape_of(model, visual)
    if named_shape is None:
        return None
    _, make_shape = named_shape
    shape = make_shape(_GEOM_SEGMENTS)
    mesh = pv.PolyData.from_regular_faces(shape.positions(*sizes(model, visual)), shape.faces)
    mesh.point_data.active_normals = shape.normals
    return mesh


def _overwrite(array: Any, values: NDArray) -> None:
    """Write new values into an array of VTK."""
    pv.convert_array(array)[:] = values
    array.Modified()


def _place(actor: pv.Actor, position: NDArray[np.float64], rotation: NDArray[np.float64]) -> None:
    pose = np.eye(4)
    pose[:3, :3] = rotation.reshape(3, 3)
    pose[:3, 3] = position
    actor.user_matrix = pose


class Shadows:
    """A shadow for each of some geoms on a horizontal plane, the `floor`."""

    def __init__(
        self, plotter: pv.Plotter, session: Session, geoms: list[GeomId], floor: GeomId
    ) -> None:
        self._session = session
        self._floor = floor
        disc = pv.Disc(
            inner=0.0, outer=1.0, normal=(0, 0, 1), r_res=_SHADOW_RINGS, c_res=_SHADOW_SIDES
        )
        dark = np.clip(1 - np.linalg.norm(disc.points, axis=1), 0, 1)
        shade = np.zeros((disc.n_points, 4), np.uint8)
        shade[:, 3] = np.rint(255 * dark * dark * (3 - 2 * dark))
        disc.point_data["shade"] = shade
        flat = {"rgb": True, "lighting": False, "reset_camera": False, "show_scalar_bar": False}
        self._actors = {geom: plotter.add_mesh(disc, scalars="shade", **flat) for geom in geoms}
        self.update()

    def update(self) -> None:
        """Take the places from the session."""
        data = self._session.simulation.data
        model = self._session.simulation.model
        ground = data.geom_xpos[self._floor, 2]
        parked = self._session.parked
        for geom, actor in self._actors.items():
            x, y, z = data.geom_xpos[geom]
            # half the vertical extent of its bounding box in the world [m]
            half = float(np.abs(data.geom_xmat[geom].reshape(3, 3)[2]) @ model.geom_aabb[geom, 3:])
            radius = float(model.geom_rbound[geom])
            above = z - half - ground
            dark = _MAX_DARKNESS * max(0.0, 1 - above / (_MAX_SHADOW_HEIGHT * radius))
            actor.SetVisibility(dark > 0 and above > -half and geom not in parked)
            actor.prop.opacity = dark
            wide = _SHADOW_WIDTH * radius * (1 + 0.1 * max(0.0, above) / radius)
            _place(
                actor, np.array([x, y, ground + _SHADOW_BIAS * radius]), np.diag([wide, wide, 1.0])
            )


class Stage:
    """Everything that a plotter shows of a session.

    Attributes
    ----------
    skins : dict
        `SkinActor` of each target, by the geom's name.
    shadows : Shadows or None
        None without a level floor.
    """

    def __init__(self, plotter: pv.Plotter, session: Session) -> None:
        self._session = session
        self._heatmap = False
        # shadows lie side by side on the floor: plain blending will do, without buffers of the
        # window's size
        plotter.renderer.SetUseOIT(False)
        plotter.set_background(BACKGROUND)
        # two lights that turn with the camera: each one more costs software OpenGL a tenth of its
        # speed
        for position, intensity in (((-0.7, 1.0, 0.9), 0.85), ((1.0, 0.1, 0.5), 0.25)):
            plotter.add_light(
                pv.Light(position=position, light_type="camera light", intensity=intensity)
            )
        simulation = session.simulation
        pose = viewpoint(simulation.model, simulation.data, simulation.scene.camera, 0.0).pose()
        width, height = plotter.window_size
        if not (pose.orthographic and pose.has_square_pixels(width / height)):
            pose = pose.in_perspective(width / height, "the viewer")
        self.skins = {
            entry.geom: SkinActor(
                plotter,
                session.meshes[entry.geom].F,
                session.skins[entry.geom],
                target_color(
                    simulation.model,
                    simulation.ripples.geom_ids[entry.geom],
                    entry.look,
                    entry.color,
                ),
            )
            for entry in simulation.scene.targets
        }
        self._bodies = BodyActors(plotter, session, pose.focus, _REACH * pose.distance)
        floor = find_floor(simulation.model, simulation.ripples.geom_ids.values())
        rigid = [
            geom for geom in simulation.ripples.geom_ids.values() if is_geom(geom, simulation.model)
        ]
        self.shadows: Shadows | None = None
        if floor is not None and simulation.data.geom_xmat[floor, 8] > _MIN_LEVEL_COSINE:
            self.shadows = Shadows(plotter, session, [*rigid, *self._bodies.solid], floor)
        first = next(iter(self.skins.values()))
        self._bar = plotter.add_scalar_bar(
            HEIGHT,
            mapper=first.actor.mapper,
            vertical=True,
            position_x=0.9,
            position_y=0.2,
            width=0.06,
            height=0.4,
            n_labels=3,
            fmt="%.3g",
            title_font_size=13,
            label_font_size=12,
            color="black",
        )
        self._bar.SetVerticalTitleSeparation(10)
        self._bar.SetVisibility(self._heatmap)
        camera = plotter.camera
        camera.position = pose.position
        camera.focal_point = pose.focus
        camera.up = (0.0, 0.0, 1.0)
        if pose.orthographic:
            camera.parallel_projection = True
            camera.parallel_scale = pose.half_height
        else:
            camera.view_angle = pose.fovy

    def update(self) -> None:
        """Bring the actors up to date with the session."""
        session = self._session
        data = session.simulation.data
        limit = round_up(session.color_range, _STEPS)
        for name, skin in self.skins.items():
            geom = session.simulation.ripples.geom_ids[name]
            skin.update(
                session.skins[name], target_pose(data, geom), limit if self._heatmap else None
            )
        self._bodies.update()
        if self.shadows is not None:
            self.shadows.update()

    def toggle_heatmap(self) -> None:
        """Show the height as colours, or the surface in its own."""
        self._heatmap = not self._heatmap
        self._bar.SetVisibility(self._heatmap)
        self.update()
