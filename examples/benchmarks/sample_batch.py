"""A batch to measure: small scenes that differ in material and camera."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

SMALL = (
    'size = [64, 64]\nduration = 0.5\nresolution = 32\nheights = true\npasses = ["depth", "flow"]\n'
)

PLAN = """
scenes = {scenes}
count = {count}
[vary]
camera.azimuth = {{uniform = [0, 360]}}
"ripple.material.speed" = {{uniform = [0.8, 1.25], apply = "multiply"}}
[store]
fps = 24
{store}"""


def write_plan(path: Path, scenes: Sequence[str], count: int, store: str = SMALL) -> Path:
    """Write a plan; `store` is what stands under [store] beside the rate. Return the path."""
    path.write_text(
        PLAN.format(scenes=str(list(scenes)).replace("'", '"'), count=count, store=store)
    )
    return path


def start(plan: Path, output: Path, *options: str) -> subprocess.Popen:
    """Begin the batch of a plan, or go on with it."""
    command = [sys.executable, "-m", "ripple_sim", "batch", str(plan), "-o", str(output), *options]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)
