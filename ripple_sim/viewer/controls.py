"""Controls of the window: keys, an orbiting camera and sliders."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from .session import SLIDERS, Session

# A key, the method of `Window` that it calls, and a short label.
CONTROLS = (
    ("space", "pause", "pause, resume"),
    ("n", "step", "next frame"),
    ("r", "reset", "reset"),
    ("t", "throw", "throw a ball"),
    ("o", "operator", "operator"),
    ("c", "colors", "heatmap on, off"),
    ("s", "screenshot", "screenshot"),
    ("v", "record", "record, stop"),
    ("h", "help", "keys on, off"),
    ("q", "quit", "quit"),
)

MOUSE = (("click", "poke"), ("drag", "orbit"), ("shift + drag", "pan"), ("wheel", "zoom"))

# [degrees]: largest elevation of the camera, up or down
_MAX_ELEVATION = 88.0

# name and unit of the first slider
_POKE_SLIDER = {"poke": "N s"}

# Left end of the first slider, distance between sliders, width of a slider, and its height above
# the lower edge, as shares of the window's size.
_SLIDER_LEFT = 0.03
_SLIDER_SPACING = 0.24
_SLIDER_WIDTH = 0.2
_SLIDER_HEIGHT = 0.07

# A knob starts at this share of its track. The track of a value of 0 goes from 0 to 1.
_KNOB_START = 1 / 3


def help_text() -> str:
    """All controls, one per line."""
    rows = [*MOUSE, *((key, label) for key, _, label in CONTROLS)]
    return "\n".join(f"{what}: {does}" for what, does in rows)


def level(camera: pv.Camera) -> None:
    """Keep the horizon level, and the camera off the vertical, where there is no horizon."""
    focus = np.array(camera.focal_point)
    x, y, z = np.array(camera.position) - focus
    if x == y == 0:  # straight above or below: what is up in the frame tells where to go
        up = np.array(camera.up[:2])
        x, y = -1e-9 * z * (up if up.any() else np.array([0.0, 1.0]))
    across = math.hypot(x, y)
    most = math.tan(math.radians(_MAX_ELEVATION))
    if across > 0 and abs(z) > most * across:
        distance = math.hypot(across, z)
        slant = math.hypot(1.0, most)
        flat = distance / slant / across
        high = math.copysign(distance * most / slant, z)
        camera.position = focus + np.array([x * flat, y * flat, high])
    camera.up = (0.0, 0.0, 1.0)


def ray(renderer: pv.Renderer, x: int, y: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The ray from the camera through a pixel, which is counted from the lower left.

    Returns its origin [m] and unit direction, in the world.
    """
    renderer.SetDisplayPoint(x, y, 0.5)
    renderer.DisplayToWorld()
    point = np.array(renderer.GetWorldPoint())
    eye = np.array(renderer.camera.position)
    point = point[:3] / point[3]
    if renderer.camera.parallel_projection:
        along = np.array(renderer.camera.direction)
        return point - ((point - eye) @ along) * along, along
    along = point - eye
    return eye, along / np.linalg.norm(along)


def add_sliders(plotter: pv.Plotter, session: Session) -> list[Any]:
    """Add them, "poke" first and then those of `SLIDERS`; they act when a knob is released."""
    return [
        _add(plotter, session, number, name, unit)
        for number, (name, unit) in enumerate((_POKE_SLIDER | SLIDERS).items())
    ]


def _add(plotter: pv.Plotter, session: Session, number: int, name: str, unit: str) -> Any:
    value = session.poke_impulse if name == "poke" else session.material(name)
    left = _SLIDER_LEFT + _SLIDER_SPACING * number
    slider = plotter.add_slider_widget(
        None, (0.0, value / _KNOB_START or 1.0), value=value, title=f"{name} [{unit}]",
        pointa=(left, _SLIDER_HEIGHT), pointb=(left + _SLIDER_WIDTH, _SLIDER_HEIGHT),
        color="black", title_height=0.02, fmt="%.4g", slider_width=0.02, tube_width=0.005,
    )  # fmt: skip
    look = slider.GetRepresentation()
    look.SetLabelHeight(0.02)
    look.SetSliderLength(0.012)
    look.SetEndCapLength(0.0)
    look.GetTubeProperty().SetColor(0.35, 0.37, 0.40)
    look.GetSliderProperty().SetColor(0.10, 0.35, 0.75)
    look.GetSelectedProperty().SetColor(0.95, 0.45, 0.10)
    slider.AddObserver("EndInteractionEvent", lambda *_: _apply(session, name, look.GetValue()))
    return slider


def _apply(session: Session, name: str, value: float) -> None:
    if name == "poke":
        session.poke_impulse = value
    else:
        session.set_material(**{name: value})
