"""Errors of the application. Like the solver's, each is a `RippleError`."""

from ripple_sim.solver.errors import RippleError


class VideoError(RippleError):
    """The ending, place, size or frame rate of a video is invalid."""


class EncodingError(RippleError):
    """Encoding or writing a video failed, for instance on a full disk."""


class SceneError(RippleError):
    """A scene file, an MJCF, or a geom named in it is invalid."""


class SimulationError(RippleError):
    """The physics became unstable."""


class DisplayError(RippleError):
    """There is no display for a window, or the web page cannot be served."""


class RippleWarning(UserWarning):
    """Something runs, but not as expected: a hull off its surface, a body too fast for the time step."""
