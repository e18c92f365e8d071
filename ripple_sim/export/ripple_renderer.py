"""`RippleRenderer`: frames of a MuJoCo model with its ripples, in your own loop."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.capture.drawn_heights import DrawnHeights
from ripple_sim.capture.target_surface import surface_of
from ripple_sim.capture.viewpoint import viewpoint
from ripple_sim.coupling.arguments import own_data, own_model
from ripple_sim.coupling.geoms import ByGeom, by_name
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.render import Camera, FixedCamera, Renderer
from ripple_sim.scene.camera import CameraEntry
from ripple_sim.solver.gl import GLContext, shared_context

from .exporter import Exporter, camera_entry
from .notebook import framed


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
        self._size, self._looks, self._limit = (width, height), named, limit
        self._seen: tuple[mujoco.MjData, CameraEntry] | None = None
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
        entry = self._entry(camera)
        self._seen = data, entry
        if camera is None or isinstance(camera, str):
            camera = viewpoint(self._model, data, entry, data.time)
        height_maps = {
            self._ripples.geom_ids[name]: height_map(self._ripples[name].snapshot(), data)
            for name, height_map in self._height_maps.items()
        }
        return self._renderer.render(data, height_maps, camera)

    def _entry(self, camera: Camera | FixedCamera | str | None) -> CameraEntry:
        """What `[camera]` of a scene file would say; MuJoCo's free camera where it has no words for it."""
        if isinstance(camera, Camera):
            return CameraEntry(**dataclasses.asdict(camera))
        return camera_entry(self._model, camera if isinstance(camera, str) else None)

    def _repr_html_(self) -> str | None:
        """In a notebook: the present state of what was rendered last, to turn and to zoom."""
        if self._seen is None:
            return None
        data, camera = self._seen
        with tempfile.TemporaryDirectory(prefix="ripple-sim-") as folder:
            page = Path(folder) / "now.html"
            with Exporter(
                self._model,
                self._ripples,
                page,
                camera=camera,
                looks=self._looks,
                size=self._size,
                limit=self._limit,
            ) as exporter:
                exporter.write(data)
            return framed(page, self._size[0] / self._size[1])
