"""Pages in a headless browser, in which nothing may go wrong."""

import base64
import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from chromium import PATIENCE
from PIL import Image

SIZE = (320, 180)


@contextlib.contextmanager
def opened(
    browser: Any,
    page: Path | str,
    size: tuple[int, int] = SIZE,
    **options: Any,
) -> Iterator[Any]:
    """A page, a file or an address, in a browser.

    Errors, also those in the console, and requests to elsewhere fail the test.
    """
    address = page if isinstance(page, str) else page.as_uri()
    tab = browser.new_page(viewport={"width": size[0], "height": size[1]}, **options)
    tab.set_default_timeout(1000 * PATIENCE)  # [ms]
    faults: list[str] = []

    def is_foreign(url: str) -> bool:
        own = isinstance(page, str) and urlsplit(url).netloc == urlsplit(page).netloc
        return url.startswith("http") and not own

    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.on(
        "console",
        lambda message: faults.append(message.text) if message.type == "error" else None,
    )
    tab.on(
        "request",
        lambda request: faults.append(request.url) if is_foreign(request.url) else None,
    )
    tab.goto(address)
    yield tab
    assert faults == []
    tab.close()


def pixels(tab: Any) -> np.ndarray:
    return image_of(tab.evaluate("ripplePlayer.player.canvas.toDataURL()"))


def image_of(uri: str) -> np.ndarray:
    return np.asarray(
        Image.open(io.BytesIO(base64.b64decode(uri.split(",")[1]))).convert("RGB")
    ).astype(int)
