"""Offscreen renderer: a MuJoCo model and its rippled targets, drawn headless into RGB frames."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
