"""The sphere map: a closed mesh of genus 0, mapped one-to-one and evenly onto the unit sphere."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
