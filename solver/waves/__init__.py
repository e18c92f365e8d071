"""Waves on an atlas: heights and velocities, the loads that raise them, and the solver that steps them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
