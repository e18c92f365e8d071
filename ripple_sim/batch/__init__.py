"""Batches: many scenes from one plan, each varied by its own seed.

Several workers make them. A batch can be killed at any time and resumed.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
