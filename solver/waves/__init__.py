"""Waves on an atlas: heights and velocities, the loads that act on them, and their solver."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
