"""Files of Universal Scene Description, and how one from here is known again."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, Tf

from ripple_sim.encode.mark import MARK

from .source import Source
from .usd import UsdWriter


def writer(source: Source, path: Path) -> UsdWriter:
    """Begin a file."""
    return UsdWriter(source, path)


def made_here(path: Path) -> bool:
    """Whether a layer has the mark as its comment."""
    if not path.is_file():
        return False
    try:
        layer = Sdf.Layer.OpenAsAnonymous(str(path), metadataOnly=True)
    except Tf.ErrorException:
        return False
    return layer is not None and layer.comment == MARK
