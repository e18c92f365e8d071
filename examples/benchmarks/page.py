"""How fast pages of exported runs play in headless Chromium without a GPU.

    ripple-sim export duck -o duck.html --resolution 64 --fps 30 --duration 5
    python examples/benchmarks/page.py duck.html [MORE.html ...]

Plays the pages at 640x360 pixels, in turns, and prints for each the frames that it showed in a
second, the processor time of all of Chromium's processes for each of them, the share of the pixels
each way that it drew, and the processor time of drawing a frame with all pixels alone, without what
the browser does to show it. Linux tells the time.
"""

import os
import shutil
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import sync_playwright

SIZE = (640, 360)
ROUNDS = 3
WARM_UP = 3.0
SECONDS = 6.0
FLAGS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
]
DRAWINGS = 40
DRAW = f"""const player = ripplePlayer.player, gl = player.drawing.gl;
player.detail.share = 1;
for (let i = 0; i < {DRAWINGS}; i++) {{
  player.redraw();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));  // waits for the drawing
}}"""
TICK = os.sysconf("SC_CLK_TCK")


def processor_time() -> float:
    """Of all processes that descend from this one, but for the driver of the browser [s]."""
    parents = {}
    times = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, fields = status.read_text().split("(", 1)[1].rsplit(")", 1)
        except OSError:  # it has ended
            continue
        parent, *_, user, kernel = fields.split()[1:13]
        parents[int(status.parent.name)] = int(parent)
        times[int(status.parent.name)] = (
            (int(user) + int(kernel)) / TICK if "chrom" in name else 0.0
        )
    ours = {os.getpid()}
    for _ in range(8):  # generations
        ours |= {process for process, parent in parents.items() if parent in ours}
    return sum(times[process] for process in ours)


def played(browser: Any, page: Path) -> tuple[float, float, float, float]:
    """Frames a second, processor time a frame [ms], changed pixels by direction, drawing [ms]."""
    tab = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
    tab.goto(page.resolve().as_uri())
    tab.evaluate("ripplePlayer.ready.then(() => 0)")
    time.sleep(WARM_UP)
    before = tab.evaluate("ripplePlayer.player.shown")
    start = time.perf_counter()
    spent = processor_time()
    time.sleep(SECONDS)
    spent = processor_time() - spent
    seconds = time.perf_counter() - start
    shown, share = tab.evaluate(
        "[ripplePlayer.player.shown, ripplePlayer.player.canvas.width / innerWidth]"
    )
    drawing = processor_time()
    tab.evaluate(f"() => {{ {DRAW} }}")
    drawing = 1e3 * (processor_time() - drawing) / DRAWINGS
    tab.close()
    return (shown - before) / seconds, 1e3 * spent / (shown - before), share, drawing


def main(pages: list[Path]) -> None:
    chromium = (
        shutil.which("chromium")
        or shutil.which("chromium-browser")
        or shutil.which("google-chrome")
    )
    results: dict[Path, list[tuple[float, ...]]] = {page: [] for page in pages}
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=FLAGS)
        for _ in range(ROUNDS):
            for page in pages:
                results[page].append(played(browser, page))
        browser.close()
    for page, rounds in results.items():
        rates, spent, shares, drawing = np.array(rounds).T
        print(f"{page.name}: {rates.min():.1f} to {rates.max():.1f} frames a second,", end=" ")
        print(
            (
                f"{np.median(spent):.1f} ({spent.min():.1f} to {spent.max():.1f}) ms of processor "
                f"time "
                f"a frame,"
            ),
            end=" ",
        )
        print(f"drawn with {shares.min():.2f} of the pixels each way;", end=" ")
        print(f"drawing alone {np.median(drawing):.1f} ms")


if __name__ == "__main__":
    main([Path(argument) for argument in sys.argv[1:]])
