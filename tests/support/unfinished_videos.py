"""What tests of videos share: an egg under a stone."""

import json
from collections.abc import Callable
from pathlib import Path

from programs import ended
from scene_files import write_scene

from ripple_sim.scene import Scene, load_scene

MJCF = """<mujoco><option timestep="0.005"/><worldbody>
<geom name="egg" type="ellipsoid" size="0.3 0.25 0.2"/>
<body name="stone" pos="0.05 0 0.3"><freejoint/><geom name="stone" size="0.05"/></body></worldbody>
</mujoco>"""
TOML = """model = "scene.xml"
duration = {}
[[ripple]]
geom = "egg"
resolution = 12
material = {{speed = 0.3, density = {}}}
"""


def egg_scene(
    folder: Path, floor: str = "", duration: float = 2.0, density: float = 1500.0
) -> Scene:
    """A scene that is written to a folder and loaded."""
    model = MJCF.replace("</worldbody>", floor + "</worldbody>")
    return load_scene(write_scene(folder, model, TOML.format(duration, density)))


def interrupting_at(frame: int) -> Callable[[int, int], None]:
    def progress(done: int, _: int) -> None:
        if done == frame:
            raise KeyboardInterrupt

    return progress


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


FULL = """
import json, resource, signal, sys
import numpy as np
from ripple_sim.errors import EncodingError
from ripple_sim.encode import open_writer
path = sys.argv[1]
limit, width, height, count = map(int, sys.argv[2:6])
options = json.loads(sys.argv[6])
shape = (count, height, width, 3)
noise = np.random.default_rng(0).integers(0, 31743, shape, np.uint16)
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
"""


def written_until_full(
    path: Path, limit: int, width: int, height: int, count: int, **options: object
) -> str:
    """What is said where so many frames of noise are written, but no file may grow beyond a limit.

    That is what a full disk does, without filling one.
    """
    result = ended(
        "-c", FULL, path, *map(str, (limit, width, height, count)), json.dumps(options), check=True
    )
    assert "Traceback" not in result.stderr
    return result.stdout
