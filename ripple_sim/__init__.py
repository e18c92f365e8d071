"""Surface ripples on any mesh, driven by the contact forces of a MuJoCo simulation."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .batch.report import load_batch
    from .coupling.colliders import make_collidable
    from .coupling.ripples import Impulse, Ripples
    from .errors import RippleWarning
    from .export.exporter import Exporter, RippleRenderer
    from .export.options import ExportOptions
    from .export.scene import export_scene
    from .render import Camera
    from .scene.load_scene import load_scene
    from .simulation import Simulation
    from .solver import Material, RippleError
    from .video.options import VideoOptions
    from .video.render_video import render_video

__version__ = "0.1.0"
__all__ = [
    "Camera",
    "ExportOptions",
    "Exporter",
    "Impulse",
    "Material",
    "RippleError",
    "RippleRenderer",
    "RippleWarning",
    "Ripples",
    "Simulation",
    "VideoOptions",
    "export_scene",
    "load_batch",
    "load_scene",
    "make_collidable",
    "render_video",
]

_HOMES = {
    "Camera": ".render",
    "ExportOptions": ".export.options",
    "Exporter": ".export.exporter",
    "Impulse": ".coupling.ripples",
    "Material": ".solver",
    "RippleError": ".solver",
    "RippleRenderer": ".export.exporter",
    "RippleWarning": ".errors",
    "Ripples": ".coupling.ripples",
    "Simulation": ".simulation",
    "VideoOptions": ".video.options",
    "export_scene": ".export.scene",
    "load_batch": ".batch.report",
    "load_scene": ".scene.load_scene",
    "make_collidable": ".coupling.colliders",
    "render_video": ".video.render_video",
}


def __getattr__(name: str) -> Any:
    # loaded when first used: importing ripple_sim must stay quick
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; valid are {', '.join(__all__)}")
    return getattr(importlib.import_module(home, __name__), name)
