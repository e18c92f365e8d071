"""Write frames of noise to a video whose file may not grow beyond a limit; print the error.

python write_until_full.py PATH LIMIT WIDTH HEIGHT COUNT OPTIONS, with the limit in bytes and the
writer's options as JSON. A full disk has the same effect as the limit.
"""

import json
import resource
import signal
import sys

import numpy as np

from ripple_sim.encode import open_writer
from ripple_sim.errors import EncodingError

LARGEST_HALF = 31743  # the bits of the largest finite float16

path = sys.argv[1]
limit, width, height, count = map(int, sys.argv[2:6])
options = json.loads(sys.argv[6])
shape = (count, height, width, 3)
noise = np.random.default_rng(0).integers(0, LARGEST_HALF, shape, np.uint16)
if options.get("frame_format") == "exr":
    noise = noise.view(np.float16)
else:
    noise = (noise % 256).astype(np.uint8)
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
try:
    with open_writer(path, width=width, height=height, fps=25, **options) as writer:
        for frame in noise:
            writer.write(frame)
except EncodingError as error:
    print(error)
