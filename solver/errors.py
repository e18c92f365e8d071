"""The errors a caller may catch. Every one of them is a `RippleError`."""


class RippleError(Exception):
    """Root of all errors that ripple-sim raises on purpose.

    The message says what was wrong, the value, what is valid, and what to do.
    """


class MeshError(RippleError):
    """The mesh cannot be read, is no surface, or does not suit the layout."""


class SphereMapError(RippleError):
    """No certified (fold-free, covering) sphere map was found for the mesh."""


class AtlasError(RippleError):
    """An atlas file or an atlas parameter is invalid."""


class SolverError(RippleError):
    """A wave parameter is invalid, or the wave field is no longer finite."""


class GLError(RippleError):
    """No usable OpenGL context, or the driver reported an error."""


class RippleWarning(UserWarning):
    """Something runs, but not as expected: a hull off its surface, a body too fast for the time step."""
