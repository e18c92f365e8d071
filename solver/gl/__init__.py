"""OpenGL: the one context of the process, its shaders and fences."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
