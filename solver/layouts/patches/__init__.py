"""The patch layout: any surface cut into square charts with a fold-free map, and texels on them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
