"""Soft round shadows on the floor, which show how high bodies and targets are."""

from __future__ import annotations

import mujoco
import numpy as np
import pyvista as pv

from .session import Session

# Darkness under a geom that touches the floor, and the height above the floor, in radii, from which it casts none.
_DARKEST, _HIGHEST = 0.42, 6.0
# Radius of a shadow over that of the geom's bounding ball, and its height above the floor, in radii.
_WIDER, _ABOVE = 1.15, 0.01
_RINGS, _SIDES = 8, 32


class Shadows:
    """A shadow for each of some geoms on a horizontal plane.

    Parameters
    ----------
    plotter : pyvista.Plotter
    session : Session
    geoms : list of int
        That cast shadows.
    floor : int
        Geom id of the plane.
    """

    def __init__(self, plotter: pv.Plotter, session: Session, geoms: list[int], floor: int) -> None:
        self._session, self._floor = session, floor
        disc = pv.Disc(inner=0.0, outer=1.0, normal=(0, 0, 1), r_res=_RINGS, c_res=_SIDES)
        dark = np.clip(1 - np.linalg.norm(disc.points, axis=1), 0, 1)
        shade = np.zeros((disc.n_points, 4), np.uint8)
        shade[:, 3] = np.rint(255 * dark * dark * (3 - 2 * dark))
        disc.point_data["shade"] = shade
        self._actors = {
            geom: plotter.add_mesh(
                disc, scalars="shade", rgb=True, lighting=False, reset_camera=False, show_scalar_bar=False
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


def _half_height(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Half the vertical extent of a geom's bounding box in the world [m]."""
    return float(np.abs(data.geom_xmat[geom].reshape(3, 3)[2]) @ model.geom_aabb[geom, 3:])
