"""Soft blots on the floor under bodies and surfaces: enough of a shadow to see how high something is."""

from __future__ import annotations

import mujoco
import numpy as np
import pyvista as pv

from .session import Session

# Darkness under something that touches the floor, and how many of its radii it has to be above the floor to cast none.
_DARKEST, _HIGHEST = 0.42, 6.0
# Radius of a blot over that of the body's bounding ball, and how far above the floor it lies, in radii.
_WIDER, _ABOVE = 1.15, 0.01
_RINGS, _SIDES = 8, 32


class Shadows:
    """A blot for each of some geoms on a horizontal plane.

    Parameters
    ----------
    plotter : pyvista.Plotter
    session : Session
    geoms : list of int
        What casts shadows.
    floor : int
        Geom id of the plane.
    """

    def __init__(self, plotter: pv.Plotter, session: Session, geoms: list[int], floor: int) -> None:
        self._session, self._floor = session, floor
        blot = pv.Disc(inner=0.0, outer=1.0, normal=(0, 0, 1), r_res=_RINGS, c_res=_SIDES)
        dark = np.clip(1 - np.linalg.norm(blot.points, axis=1), 0, 1)
        shade = np.zeros((blot.n_points, 4), np.uint8)
        shade[:, 3] = np.rint(255 * dark * dark * (3 - 2 * dark))
        blot.point_data["shade"] = shade
        self._actors = {
            geom: plotter.add_mesh(
                blot, scalars="shade", rgb=True, lighting=False, reset_camera=False, show_scalar_bar=False
            )
            for geom in geoms
        }
        self.update()

    def update(self) -> None:
        """Take the places from the session."""
        data, model = self._session.simulation.data, self._session.simulation.model
        ground = data.geom_xpos[self._floor, 2]
        parked = self._session.parked
        for geom, actor in self._actors.items():
            x, y, z = data.geom_xpos[geom]
            half = _half_height(model, data, geom)
            radius = float(model.geom_rbound[geom])
            above = z - half - ground
            dark = _DARKEST * max(0.0, 1 - above / (_HIGHEST * radius))
            actor.SetVisibility(dark > 0 and above > -half and geom not in parked)
            actor.prop.opacity = dark
            wide = _WIDER * radius * (1 + 0.1 * max(0.0, above) / radius)
            pose = np.diag([wide, wide, 1.0, 1.0])
            pose[:3, 3] = x, y, ground + _ABOVE * radius
            actor.user_matrix = pose


def find_floor(model: mujoco.MjModel, data: mujoco.MjData) -> int | None:
    """Geom id of the highest plane that faces up, or None."""
    planes = [
        geom
        for geom in range(model.ngeom)
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE and data.geom_xmat[geom, 8] > 0.999
    ]
    return max(planes, key=lambda geom: float(data.geom_xpos[geom, 2]), default=None)


def _half_height(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Half the vertical extent of a geom's bounding box in the world [m]."""
    return float(np.abs(data.geom_xmat[geom].reshape(3, 3)[2]) @ model.geom_aabb[geom, 3:])
