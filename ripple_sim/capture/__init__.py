"""From a running simulation to frames: snapshots, shutter, exposure, camera."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
