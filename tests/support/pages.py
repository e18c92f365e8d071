"""Pages in a headless browser, in which nothing may go wrong."""

import base64
import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from chromium import PATIENCE
from PIL import Image

SIZE = (320, 180)


@contextlib.contextmanager
def opened(browser: Any, page: Path, size: tuple[int, int] = SIZE, **options: Any) -> Iterator[Any]:
    """A page in a browser. Errors, also those in the console, and requests fail the test."""
    tab = browser.new_page(viewport={"width": size[0], "height": size[1]}, **options)
    tab.set_default_timeout(1000 * PATIENCE)  # [ms]
    faults: list[str] = []
    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.on(
        "console",
        lambda message: faults.append(message.text) if message.type == "error" else None,
    )
    tab.on(
        "request",
        lambda request: faults.append(request.url) if request.url.startswith("http") else None,
    )
    tab.goto(page.as_uri())
    yield tab
    assert faults == []
    tab.close()


def pixels(tab: Any) -> np.ndarray:
    return image_of(tab.evaluate("ripplePlayer.player.canvas.toDataURL()"))


def image_of(uri: str) -> np.ndarray:
    return np.asarray(
        Image.open(io.BytesIO(base64.b64decode(uri.split(",")[1]))).convert("RGB")
    ).astype(int)
