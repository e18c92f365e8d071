"""Batches: many scenes by one plan, each varied by its own seed, made by many workers, resumed after any kill."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
