"""Interactive viewer: `Session` runs a scene without a window, `Window` shows it with PyVista.

A PyVista plotter makes other OpenGL contexts of its process unusable, so a window needs a process
of its own, such as `ripple-sim view`, where the waves are solved on the CPU.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
