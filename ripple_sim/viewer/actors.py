"""Geoms and skins as PyVista actors."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from ripple_sim.render.visuals.shapes import shape_of, sizes
from ripple_sim.render.visuals.visual import geom_visual, visible_geoms

from .floor import add_floor, is_endless
from .session import Session
from .skin import Skin

HEIGHT = "height [mm]"
_PER_METRE = 1000.0

_GEOM = mujoco.mjtGeom
_COLORMAP = "coolwarm"
_SEGMENTS = 8  # of a geom, per right angle


class BodyActors:
    """The geoms of a model that do not ripple, moved by MuJoCo's poses.

    Parameters
    ----------
    plotter : pyvista.Plotter
    session : Session
    middle : float64 [3]
        Of the view [m].
    reach : float
        Bodies farther than this from the middle wait for their turn, and are hidden [m].
    """

    def __init__(self, plotter: pv.Plotter, session: Session, middle: NDArray[np.float64], reach: float) -> None:
        self._session, self._middle, self._reach = session, middle, reach
        model = session.simulation.model
        self._actors = {}
        for geom in visible_geoms(model):
            if geom in session.simulation.ripples.geom_ids.values():
                continue
            rgba = geom_visual(model, geom).rgba
            if is_endless(model, geom, reach):
                position, rotation = self._pose(geom)
                self._actors[geom] = add_floor(plotter, (middle - position) @ rotation, reach, rgba)
            elif (mesh := geom_mesh(model, geom)) is not None:
                self._actors[geom] = _add(plotter, mesh, rgba)
        self.update()

    @property
    def solid(self) -> list[int]:
        """Visible geoms except planes."""
        kinds = self._session.simulation.model.geom_type
        return [geom for geom in self._actors if kinds[geom] != _GEOM.mjGEOM_PLANE]

    def update(self) -> None:
        """Take the poses from the session."""
        parked, solid = self._session.parked, set(self.solid)
        for geom, actor in self._actors.items():
            position, rotation = self._pose(geom)
            _place(actor, position, rotation)
            far = geom in solid and np.linalg.norm(position - self._middle) > self._reach
            actor.SetVisibility(not (far or geom in parked))

    def _pose(self, geom: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position [m] and rotation matrix in the world."""
        data = self._session.simulation.data
        return data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)


class SkinActor:
    """A rippling surface: its points, normals and heights are written into the arrays that VTK reads.

    Parameters
    ----------
    plotter : pyvista.Plotter
    skin : Skin
    color : tuple
        sRGB, 0 to 1.
    """

    def __init__(self, plotter: pv.Plotter, skin: Skin, color: NDArray[np.float64]) -> None:
        mesh = pv.PolyData.from_regular_faces(skin.points, skin.F)
        mesh.point_data.active_normals = skin.normals
        mesh.point_data.set_array(_PER_METRE * skin.height, HEIGHT)
        mesh.set_active_scalars(HEIGHT)
        self._skin, self._mesh = skin, mesh
        self.actor = plotter.add_mesh(
            mesh,
            scalars=HEIGHT,
            cmap=_COLORMAP,
            clim=(-1.0, 1.0),
            color=color.tolist(),
            show_scalar_bar=False,
            copy_mesh=False,
            interpolation="Phong",
            **_SHADING,
        )
        self.actor.prop.specular_color = "white"

    def update(self, position: NDArray[np.float64], rotation: NDArray[np.float64]) -> None:
        """Take the skin's present points, normals and heights, and its pose in the world."""
        mesh, skin = self._mesh, self._skin
        mesh.points[:] = skin.points
        data = mesh.GetPointData()
        for array, new in ((data.GetNormals(), skin.normals), (data.GetArray(HEIGHT), _PER_METRE * skin.height)):
            pv.convert_array(array)[:] = new
            array.Modified()
        mesh.GetPoints().Modified()
        _place(self.actor, position, rotation)

    def color_by_height(self, limit: float | None) -> None:
        """Show the height as colours from minus to plus a limit [m]; with None, the surface in its own colour."""
        mapper = self.actor.mapper
        mapper.scalar_visibility = limit is not None
        if limit is not None:
            mapper.scalar_range = (-_PER_METRE * limit, _PER_METRE * limit)


_SHADING: dict[str, Any] = {"ambient": 0.32, "diffuse": 0.75, "specular": 0.3, "specular_power": 30.0}


def geom_mesh(model: mujoco.MjModel, geom: int) -> pv.PolyData | None:
    """Surface of a geom in its frame [m], with normals; None for types that cannot be drawn."""
    visual = geom_visual(model, geom)
    found = shape_of(model, visual)
    if found is None:
        return None
    _, make = found
    shape = make(_SEGMENTS)
    mesh = pv.PolyData.from_regular_faces(shape.positions(*sizes(model, visual)), shape.faces)
    mesh.point_data.active_normals = shape.normals
    return mesh


def _add(plotter: pv.Plotter, mesh: pv.PolyData, rgba: NDArray[np.float64]) -> pv.Actor:
    return plotter.add_mesh(
        mesh, color=rgba[:3].tolist(), opacity=float(rgba[3]), interpolation="Phong", reset_camera=False, **_SHADING
    )


def _place(actor: pv.Actor, position: NDArray[np.float64], rotation: NDArray[np.float64]) -> None:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.reshape(3, 3), position
    actor.user_matrix = pose
