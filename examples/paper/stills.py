"""Single frames of a scene."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from ripple_sim import Scene, VideoOptions, render_video

RATE = 20  # frames a second, the grid of times to choose from


def strip(
    scene: Scene,
    times: Sequence[float],
    file: Path,
    size: tuple[int, int],
    columns: int = 4,
    **options: Any,
) -> Path:
    """Write frames of a scene at the given times [s], so many side by side."""
    width, height = size
    columns = min(columns, len(times))
    with tempfile.TemporaryDirectory() as folder:
        frames = Path(folder) / "frames"
        render_video(
            scene,
            frames,
            VideoOptions(size=size, fps=RATE, duration=max(times) + 1 / RATE, **options),
        )
        drawn = sorted(frames.glob("*.png"))
        picture = Image.new("RGB", (width * columns, height * -(-len(times) // columns)))
        for i, time in enumerate(times):
            place = (i % columns * width, i // columns * height)
            picture.paste(Image.open(drawn[round(time * RATE)]).convert("RGB"), place)
    picture.save(file)
    return file
