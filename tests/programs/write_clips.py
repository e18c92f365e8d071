"""Write the clips of tests/encode/test_part.py one after another; continue unfinished clips.

python write_clips.py FOLDER SETTINGS, with the settings as JSON: endings, frames, width, height,
fps, and the settings of the writer.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np

from ripple_sim.encode import open_writer

SQUARE = 20  # side of the moving square [pixels]
STEPS = 40  # the square begins again after so many frames

folder = Path(sys.argv[1])
given = json.loads(sys.argv[2])
size = {"width": given["width"], "height": given["height"]}
print("ready", flush=True)
for ending in given["endings"]:
    path = folder / f"clip{ending}"
    if path.exists() and not path.with_name(path.name + ".part").exists():
        continue
    with open_writer(
        path, **size, fps=given["fps"], settings=given["settings"], resume=True
    ) as writer:
        for number in range(writer.frames, given["frames"]):
            frame = np.full((size["height"], size["width"], 3), 60, np.uint8)
            left = number % STEPS
            frame[10:30, left : left + SQUARE] = (230, 180, number)
            writer.write(frame)
            time.sleep(0.001)  # so that a kill may come between frames
