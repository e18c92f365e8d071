"""OpenGL drivers that render on the processor. EGL falls back to one of them without saying so."""

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swr", "software")


def is_software(renderer: str) -> bool:
    """Whether a driver renders on the processor, by its GL_RENDERER."""
    name = renderer.lower()
    return any(word in name for word in _SOFTWARE)
