"""What tests of videos share: an egg under a stone."""

import json
from collections.abc import Callable
from pathlib import Path

from programs import PROGRAMS, ended
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


def written_until_full(
    path: Path, limit: int, width: int, height: int, count: int, **options: object
) -> str:
    """The error of a video of noise whose files may not grow beyond a limit, as on a full disk."""
    numbers = map(str, (limit, width, height, count))
    program = PROGRAMS / "write_until_full.py"
    result = ended(program, path, *numbers, json.dumps(options), check=True)
    assert "Traceback" not in result.stderr
    return result.stdout
