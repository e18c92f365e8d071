"""The sliders at the window's lower edge: the poke's impulse, and the material."""

from __future__ import annotations

from typing import Any

import pyvista as pv

from .session import SLIDERS, Session

_POKE = {"poke": "N s"}
# Left end, distance, width and height in the window, in shares of its size.
_LEFT, _APART, _WIDTH, _HEIGHT = 0.03, 0.24, 0.2, 0.07
# A knob starts at this share of its track; one at 0 has a track from 0 to 1.
_START = 1 / 3


def add_sliders(plotter: pv.Plotter, session: Session) -> list[Any]:
    """Add them, "poke" first and then those of `SLIDERS`; they act when a knob is released."""
    return [_add(plotter, session, number, name, unit) for number, (name, unit) in enumerate((_POKE | SLIDERS).items())]


def _add(plotter: pv.Plotter, session: Session, number: int, name: str, unit: str) -> Any:
    value = session.poke_impulse if name == "poke" else session.material(name)
    left = _LEFT + _APART * number
    slider = plotter.add_slider_widget(
        None, (0.0, value / _START or 1.0), value=value, title=f"{name} [{unit}]",
        pointa=(left, _HEIGHT), pointb=(left + _WIDTH, _HEIGHT),
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
