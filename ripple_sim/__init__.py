"""Surface ripples on any mesh, driven by the contact forces of a MuJoCo simulation."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

__version__ = "1.0.0"
