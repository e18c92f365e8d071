"""Errors of the application. Like the solver's, each is a `RippleError`."""

from ripple_sim.solver.errors import RippleError, RippleWarning

__all__ = [
    "BatchError",
    "DisplayError",
    "EncodingError",
    "ExportError",
    "RenderError",
    "RippleError",
    "RippleWarning",
    "SceneError",
    "SimulationError",
    "VideoError",
]


class BatchError(RippleError):
    """A batch cannot continue in its folder: the plan has changed, or the disk is full."""


class VideoError(RippleError):
    """The ending, place, size or frame rate of a video is invalid."""


class ExportError(RippleError):
    """The ending or the place of an export is invalid, or a package for it is missing."""


class EncodingError(RippleError):
    """Encoding or writing a file failed, for instance on a full disk."""


class SceneError(RippleError):
    """A scene file, an MJCF, or a geom named in it is invalid."""


class RenderError(SceneError, ValueError):
    """A renderer is given what it cannot take; a ValueError, as in `mujoco.Renderer`."""


class SimulationError(RippleError):
    """The physics became unstable."""


class DisplayError(RippleError):
    """There is no display for a window, or the web page cannot be served."""
