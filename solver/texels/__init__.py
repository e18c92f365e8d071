"""The texel mesh: charts of texels, how they are connected, and what is computed on them; the atlas on a surface."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
