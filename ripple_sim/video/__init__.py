"""Videos of scenes: simulation, rendering and encoding at the same time."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
