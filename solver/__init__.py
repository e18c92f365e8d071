"""Surface waves on meshes: mesh -> layout -> atlas -> operator -> waves. Knows nothing of MuJoCo.

The public names load their modules when they are first used, so that importing this package is
quick.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
