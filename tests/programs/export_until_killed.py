"""Export a scene, and kill this process after a number of frames.

python export_until_killed.py SCENE FILE OPTIONS FRAMES, with the export's options as JSON.
"""

import json
import os
import signal
import sys
from pathlib import Path

from ripple_sim import ExportOptions, export_scene, load_scene

scene_file, export_file, options, last_frame = sys.argv[1:]


def kill_at_last_frame(finished: int, frames: int) -> None:
    if finished == int(last_frame):
        os.kill(os.getpid(), signal.SIGKILL)


scene = load_scene(scene_file)
options = ExportOptions(**json.loads(options))
export_scene(scene, Path(export_file), options, progress=kill_at_last_frame)
