"""Encoding: frames go in one by one; a complete file or folder appears at the end.

After an error nothing appears.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
