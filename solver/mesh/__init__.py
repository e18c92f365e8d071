"""Triangle meshes: read from files, cleaned, cut to manifold sheets, repaired or wrapped."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
