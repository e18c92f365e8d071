"""Surface ripples on any mesh, driven by the contact forces of a MuJoCo simulation."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .batch.plan import read_plan
    from .batch.report import load_batch
    from .batch.run import RunOptions, run_batch
    from .coupling.colliders import make_collidable
    from .coupling.ripples import Impulse, Ripples
    from .errors import RippleWarning
    from .export.exporter import Exporter, RippleRenderer
    from .export.options import ExportOptions
    from .export.scene import export_scene
    from .figures.atlas_plot import plot_atlas
    from .render import Camera
    from .scene.drop import drop_scene
    from .scene.load_scene import load_scene
    from .scene.scene import Scene
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
    "RunOptions",
    "Scene",
    "Simulation",
    "VideoOptions",
    "drop_scene",
    "export_scene",
    "load_batch",
    "load_scene",
    "make_collidable",
    "plot_atlas",
    "read_plan",
    "render_video",
    "run_batch",
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
    "RunOptions": ".batch.run",
    "Scene": ".scene.scene",
    "Simulation": ".simulation",
    "VideoOptions": ".video.options",
    "drop_scene": ".scene.drop",
    "export_scene": ".export.scene",
    "load_batch": ".batch.report",
    "load_scene": ".scene.load_scene",
    "make_collidable": ".coupling.colliders",
    "plot_atlas": ".figures.atlas_plot",
    "read_plan": ".batch.plan",
    "render_video": ".video.render_video",
    "run_batch": ".batch.run",
}


def __getattr__(name: str) -> Any:
    # loaded when first used: importing ripple_sim must stay quick
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; valid are {', '.join(__all__)}")
    return getattr(importlib.import_module(home, __name__), name)
