"""The passes of a frame: shadow maps, floor, G-buffer, deferred shading."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
