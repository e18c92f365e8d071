"""A stand-in for Blender's Python: it makes frames of its settings, as bright as their numbers.

With -c it prints the version of bpy. Otherwise its argument is the file of settings. Environment
variables say what it does: BPY_VERSION, SETTINGS_COPY (where to copy the settings), and
FAILING_FRAME (the frame at which it runs out of memory, -1 for none).
"""

import json
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

if sys.argv[1] == "-c":
    print(os.environ["BPY_VERSION"])
    sys.exit()
settings = json.loads(Path(sys.argv[2]).read_text())
assert tempfile.gettempdir() == settings["folder"], "temporary files would be left behind"
Path(os.environ["SETTINGS_COPY"]).write_text(json.dumps(settings))
assert Path(settings["stage"]).stat().st_size > 1000
width, height = settings["size"]
for number in range(settings["frames"]):
    if number == int(os.environ["FAILING_FRAME"]):
        sys.exit("out of memory")
    picture = np.full((height, width, 3), 0.2 * number, np.float32)
    np.save(Path(settings["folder"], f"{number}.npy"), picture)
    print("Blender's own words")
    print(f"frame {number}", flush=True)
