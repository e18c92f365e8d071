"""`RippleRenderer`: frames of a MuJoCo model with its ripples, in your own loop."""

from __future__ import annotations

import io

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.coupling.arguments import own_data, own_model
from ripple_sim.coupling.model.geoms import ByGeom, by_name
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.render import Camera, FixedCamera, Renderer, Surface
from ripple_sim.render.surfaces.charts import Charts
from ripple_sim.scene.camera import CameraEntry
from ripple_sim.solver import WaveSolver
from ripple_sim.solver.gl import GLContext, shared_context

from .drawn_heights import DrawnHeights
from .viewpoint import viewpoint


class RippleRenderer:
    """Renders a model and its rippling surfaces offscreen, as `mujoco.Renderer` renders a model.

    Parameters
    ----------
    model : mujoco.MjModel
        Or dm_control's wrapper of one; likewise the data of each frame.
    ripples : Ripples
        Whose targets are drawn with their ripples.
    width : int
        [pixels].
    height : int
        [pixels].
    looks : mapping
        Geom, by its name or id, to the look of its surface, one of `LOOKS`: rubber (the default), jelly, clay and so
        on. Its colour is the geom's, where the model gives it a texture or a colour, as in a scene file.
    gl : GLContext, optional
        By default the process's shared one.
    limit : bool
        Whether heights that are too large for the object are drawn smaller, so that its surface does not pass through
        itself; see `DisplacementLimit`.

    Raises
    ------
    RippleError
        For an unknown look or geom, or if the driver cannot render frames of this size.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        ripples: Ripples,
        *,
        width: int = 1280,
        height: int = 720,
        looks: ByGeom[str] | None = None,
        gl: GLContext | None = None,
        limit: bool = True,
    ) -> None:
        self._model, self._ripples = own_model(model), ripples
        self._height_maps = {name: DrawnHeights(ripples, name, limit) for name in ripples}
        named = by_name(self._model, looks or {}, "looks")
        surfaces = {
            geom: surface_of(ripples[name], named.get(name, "rubber")) for name, geom in ripples.geom_ids.items()
        }
        self._shown: NDArray[np.uint8] | None = None
        self._renderer = Renderer(gl or shared_context(), self._model, surfaces, size=(width, height))

    def render(self, data: mujoco.MjData, camera: Camera | FixedCamera | str | None = None) -> NDArray[np.uint8]:
        """Render the present state to pixels, uint8 [height, width, 3].

        Parameters
        ----------
        data : mujoco.MjData
            After `mj_step` or `mj_forward`.
        camera : Camera, FixedCamera or str, optional
            A camera, or the name of one in the MJCF; by default MuJoCo's free camera, aimed at the model's middle.
        """
        data = own_data(self._model, data)
        if camera is None or isinstance(camera, str):
            free = self._model.vis.global_
            entry = CameraEntry(name=camera, azimuth=free.azimuth, elevation=free.elevation, fovy=free.fovy)
            camera = viewpoint(self._model, data, entry, data.time)
        height_maps = {
            self._ripples.geom_ids[name]: height_map(self._ripples[name].snapshot(), data)
            for name, height_map in self._height_maps.items()
        }
        self._shown = self._renderer.render(data, height_maps, camera)
        return self._shown

    def _repr_png_(self) -> bytes | None:
        """In a notebook: what was rendered last."""
        if self._shown is None:
            return None
        file = io.BytesIO()
        Image.fromarray(self._shown).save(file, "PNG")
        return file.getvalue()


def surface_of(waves: WaveSolver, look: str, color: tuple[float, float, float] | None = None) -> Surface:
    """Surface to be drawn of a target."""
    atlas = waves.rest
    mesh = atlas.mesh
    return Surface(
        V=mesh.V,
        F=mesh.F,
        charts=Charts.of(atlas),
        look=look,
        color=color,
        uv=mesh.uv if mesh.corner_uv is None else mesh.corner_uv,
    )
