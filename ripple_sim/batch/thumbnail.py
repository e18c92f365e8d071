"""A small image of a scene, from the middle of its video."""

from __future__ import annotations

from pathlib import Path

import av
from PIL import Image

from ripple_sim.solver.files import atomic_write

_SIZE = 160  # its longer edge [pixels]


def write_thumbnail(video: Path, output: Path) -> None:
    """Write a JPEG of the middle frame of a video or a folder of PNG frames; of EXR frames there is none."""
    if video.is_dir():
        frames = sorted(video.glob("*.png"))
        middle: Image.Image | None = Image.open(frames[len(frames) // 2]) if frames else None
    else:
        middle = _middle_frame(video)
    if middle is not None:
        image = middle.convert("RGB")
        image.thumbnail((_SIZE, _SIZE))
        with atomic_write(output) as path:
            image.save(path, format="JPEG", quality=80)


def _middle_frame(video: Path) -> Image.Image | None:
    if video.suffix in (".gif", ".webp"):
        with Image.open(video) as image:
            image.seek(getattr(image, "n_frames", 1) // 2)
            return image.copy()
    with av.open(str(video)) as container:
        stream = container.streams.video[0]
        middle = (stream.frames or 1) // 2
        for number, frame in enumerate(container.decode(stream)):
            if number == middle:
                return frame.to_image()
    return None
