"""The command line: one typed class per command, errors as one line, reports of an atlas."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
