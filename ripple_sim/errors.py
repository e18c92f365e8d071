"""Errors of the application. Like the solver's, every one of them is a `RippleError`."""

from ripple_sim.solver.errors import RippleError


class VideoError(RippleError):
    """A video cannot be written like this: its ending, place, size or frame rate is invalid."""


class EncodingError(RippleError):
    """Encoding or writing a video failed half-way, for instance on a full disk."""


class SceneError(RippleError):
    """A scene file, an MJCF, or a geom named in it is invalid."""


class SimulationError(RippleError):
    """The physics became unstable."""


class DisplayError(RippleError):
    """There is no display to open a window on, or what serves the web page in its stead is not installed."""


class RippleWarning(UserWarning):
    """Something that runs, but not as one would expect: a hull off its surface, a body too fast for the time step."""
