"""Encoding: frames go in one by one, a finished file or folder of frames appears at the end or not at all."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
