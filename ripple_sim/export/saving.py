"""Saving layers, with USD's errors as those of the operating system."""

from __future__ import annotations

import re
from collections.abc import Callable

from pxr import Sdf, Tf


def save(layer: Sdf.Layer) -> None:
    """Write a layer to its file.

    Raises
    ------
    OSError
    """
    succeed(layer.Save)


def succeed(work: Callable[..., bool], *arguments: object) -> None:
    """Do what says whether it could write, and raise OSError if it could not."""
    try:
        if work(*arguments):
            return
        reason = "it could not be written"
    except Tf.ErrorException as error:
        text = " ".join(str(error).split())
        reason = first[1] if (first := re.search(r"line \d+ in file \S+ : '(.*?)'(?= Error in |$)", text)) else text
    raise OSError(reason)
