"""The cube layout: a closed genus-0 mesh on six charts, by way of its sphere map."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
