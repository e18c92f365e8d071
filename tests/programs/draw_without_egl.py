"""Draw the frames of `floor_scenes` without EGL's library: python draw_without_egl.py RESULT.

Another thread draws than the one that made the context. A display of X11 gives GLX. RESULT is an
.npz file.
"""

import sys
import threading

import numpy as np
from floor_scenes import floor_frames

from ripple_sim.solver.gl import creation, current, shared_context


def no_egl() -> bool:
    return False


creation.egl_exists = no_egl
current.egl_exists = no_egl
gl = shared_context()
assert type(gl._current) is current.GLXCurrent
assert current.GLXCurrent.of_thread() is None, "the new context is not left"
frames = []
thread = threading.Thread(target=lambda: frames.extend(floor_frames()))
thread.start()
thread.join()
np.savez(sys.argv[1], *frames)
