"""A headless browser for pages."""

import contextlib
import shutil
from collections.abc import Iterator
from typing import Any

import pytest

playwright = pytest.importorskip("playwright.sync_api")

CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
# [s]; the machine may be busy, and kernels that no test has used yet are compiled meanwhile
PATIENCE = 180.0


@contextlib.contextmanager
def launched(*flags: str) -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("needs Chromium (on Debian: apt-get install chromium)")
    options = ["--no-sandbox", "--disable-background-networking", *flags]
    with playwright.sync_playwright() as driver:
        # [ms]
        browser = driver.chromium.launch(
            executable_path=CHROMIUM, args=options, timeout=1000 * PATIENCE
        )
        yield browser
        browser.close()
