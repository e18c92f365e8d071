"""The texel mesh, charts of texels on a surface, and the atlas, which adds the mesh below."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
