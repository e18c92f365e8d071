"""`Stage`: a session's targets, bodies, shadows and lights in a PyVista plotter."""

from __future__ import annotations

import math

import pyvista as pv

from ripple_sim.capture.viewpoint import viewpoint
from ripple_sim.coupling.soft_ids import is_soft, target_pose
from ripple_sim.render.surfaces.surface import target_color

from .actors import HEIGHT, BodyActors, SkinActor
from .floor import BACKGROUND, find_floor
from .session import Session
from .shadows import Shadows

# Bodies farther away than this many distances of the first camera wait for their turn, and are hidden.
_REACH = 4.0


class Stage:
    """Everything that a plotter shows of a session.

    Parameters
    ----------
    plotter : pyvista.Plotter
    session : Session

    Attributes
    ----------
    skins : dict
        `SkinActor` of each target, by the geom's name.
    shadows : Shadows or None
        None without a floor.
    """

    def __init__(self, plotter: pv.Plotter, session: Session) -> None:
        self._plotter, self._session = plotter, session
        self._heatmap = True
        # shadows lie side by side on the floor: plain blending will do, without buffers of the window's size
        plotter.renderer.SetUseOIT(False)
        plotter.set_background(BACKGROUND)
        # two lights that turn with the camera: each one more costs software OpenGL a tenth of its speed
        for position, intensity in (((-0.7, 1.0, 0.9), 0.85), ((1.0, 0.1, 0.5), 0.25)):
            plotter.add_light(pv.Light(position=position, light_type="camera light", intensity=intensity))
        simulation = session.simulation
        pose = viewpoint(simulation.model, simulation.data, simulation.scene.camera, 0.0).pose()
        self.skins = {
            entry.geom: SkinActor(
                plotter,
                session.skins[entry.geom],
                target_color(simulation.model, simulation.ripples.geom_ids[entry.geom], entry.look, entry.color),
            )
            for entry in simulation.scene.targets
        }
        self._bodies = BodyActors(plotter, session, pose.focus, _REACH * pose.distance)
        floor = find_floor(simulation.model, simulation.data)
        rigid = [geom for geom in simulation.ripples.geom_ids.values() if not is_soft(simulation.model, geom)]
        casting = [*rigid, *self._bodies.solid]
        self.shadows = None if floor is None else Shadows(plotter, session, casting, floor)
        self._add_bar()
        camera = plotter.camera
        camera.position, camera.focal_point, camera.up = pose.position, pose.focus, (0.0, 0.0, 1.0)
        camera.view_angle = pose.fovy

    def update(self) -> None:
        """Bring the actors up to date with the session."""
        session = self._session
        data, limit = session.simulation.data, _round_up(session.color_range)
        for name, skin in self.skins.items():
            geom = session.simulation.ripples.geom_ids[name]
            skin.update(*target_pose(data, geom))
            skin.color_by_height(limit if self._heatmap else None)
        self._bodies.update()
        if self.shadows is not None:
            self.shadows.update()

    def toggle_heatmap(self) -> None:
        """Show the height as colours, or the surface in its own."""
        self._heatmap = not self._heatmap
        self._bar.SetVisibility(self._heatmap)
        self.update()

    def _add_bar(self) -> None:
        first = next(iter(self.skins.values()))
        self._bar = self._plotter.add_scalar_bar(
            HEIGHT, mapper=first.actor.mapper, vertical=True, position_x=0.9, position_y=0.2, width=0.06, height=0.4,
            n_labels=3, fmt="%.3g", title_font_size=13, label_font_size=12, color="black",
        )  # fmt: skip
        self._bar.SetVerticalTitleSeparation(10)


def _round_up(value: float) -> float:
    """Round up to 1, 2 or 5 times a power of ten, so that a scale does not change with every frame."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if value <= step * power * (1 + 1e-12))
