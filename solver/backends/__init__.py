"""Backends: the waves computed on the CPU or in compute shaders."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
