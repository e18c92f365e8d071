"""Scenes: an MJCF model, its targets, a camera and timed events, read from one TOML file."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
