"""The floor: the plane that shadows fall on, and a large plane drawn as a disc that fades into the background."""

from __future__ import annotations

import mujoco
import numpy as np
import pyvista as pv
from numpy.typing import NDArray

_PLANE = mujoco.mjtGeom.mjGEOM_PLANE
BACKGROUND = (0.74, 0.77, 0.81)
_FADE_RINGS, _FADE_SIDES = 24, 72


def find_floor(model: mujoco.MjModel, data: mujoco.MjData) -> int | None:
    """Geom id of the highest plane that faces up, or None."""
    planes = [
        geom for geom in range(model.ngeom) if model.geom_type[geom] == _PLANE and data.geom_xmat[geom, 8] > 0.999
    ]
    return max(planes, key=lambda geom: float(data.geom_xpos[geom, 2]), default=None)


def is_endless(model: mujoco.MjModel, geom: int, reach: float) -> bool:
    """Whether a geom is a plane that is infinite or extends beyond the view."""
    size = model.geom_size[geom, :2]
    return model.geom_type[geom] == _PLANE and bool(((size <= 0) | (size > reach / 2)).all())


def add_floor(plotter: pv.Plotter, middle: NDArray[np.float64], radius: float, rgba: NDArray[np.float64]) -> pv.Actor:
    """Add a plane as a disc around a middle [m], unlit: software OpenGL is much slower with light, and it is large."""
    disc = pv.Disc(inner=0.0, outer=radius, normal=(0, 0, 1), r_res=_FADE_RINGS, c_res=_FADE_SIDES)
    away = np.linalg.norm(disc.points, axis=1) / radius
    share = np.clip((away - 0.1) / 0.7, 0, 1)[:, None]
    share = share * share * (3 - 2 * share)
    colors = (1 - share) * rgba[:3] + share * np.array(BACKGROUND)
    disc.points[:, :2] += middle[:2]
    disc.point_data["color"] = np.rint(255 * colors).astype(np.uint8)
    return plotter.add_mesh(disc, scalars="color", rgb=True, lighting=False, reset_camera=False)
