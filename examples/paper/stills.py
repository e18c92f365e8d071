"""Single frames of a scene."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from ripple_sim.job import render_video
from ripple_sim.scene.scene import Scene

RATE = 20  # frames a second, the grid of times to choose from


def strip(scene: Scene, times: Sequence[float], file: Path, size: tuple[int, int], **options: Any) -> Path:
    """Write frames of a scene at the given times [s] side by side."""
    with tempfile.TemporaryDirectory() as folder:
        frames = Path(folder) / "frames"
        render_video(scene, frames, size=size, fps=RATE, duration=max(times) + 1 / RATE, **options)
        drawn = sorted(frames.glob("*.png"))
        picture = Image.new("RGB", (size[0] * len(times), size[1]))
        for i, time in enumerate(times):
            picture.paste(Image.open(drawn[round(time * RATE)]).convert("RGB"), (i * size[0], 0))
    picture.save(file)
    return file
