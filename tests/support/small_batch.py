"""A batch of small scenes, which take a fraction of a second each."""

from concurrent.futures import Executor, Future
from pathlib import Path

from scene_files import write_scene
from unfinished_videos import contents

from ripple_sim.batch import BatchFolder, Plan, keep_plan, read_plan, stored

MJCF = """<mujoco><option timestep="0.005"/><worldbody><light name="key" pos="0 0 3"/>
<geom name="egg" type="ellipsoid" size="0.3 0.25 0.2"/>
<body name="stone" pos="0.05 0 0.28"><freejoint/><geom name="stone" size="0.05"/></body>
<body name="grain" pos="-0.05 0 0.28"><freejoint/><geom name="grain" size="0.03"/></body>
</worldbody></mujoco>"""

SCENE = """model = "scene.xml"
duration = 0.2
[camera]
lookat = [0.0, 0.0, 0.1]
[[ripple]]
geom = "egg"
resolution = 8
material = {speed = 0.3, density = 1500.0}
"""

PLAN = """scenes = ["scene.toml"]
count = 5
seed = 3
[vary]
camera.azimuth = {uniform = [0, 360]}
"ripple[egg].material.speed" = {log_uniform = [0.2, 0.5]}
[model]
"geom[stone].mass" = {uniform = [0.5, 2], apply = "multiply"}
[store]
size = [64, 48]
fps = 20
"""


class Here(Executor):
    """Does the work in this process, at once."""

    places = 2

    def __init__(self, workers):
        self.workers = workers

    def submit(self, function, /, *arguments, **named):
        future = Future()
        try:
            future.set_result(function(*arguments, **named))
        except BaseException as error:
            future.set_exception(error)
        return future


def write_files(folder: Path) -> None:
    write_scene(folder, MJCF, SCENE)


def small_plan(folder: Path, more: str = "", text: str = PLAN) -> Plan:
    """The plan with more in its last table, [store], and its files."""
    write_files(folder)
    path = folder / "plan.toml"
    path.write_text(text + more)
    return read_plan(path)


def new_batch(folder: Path, more: str = "") -> BatchFolder:
    """The folder of a batch with its plan and no scene."""
    folder.mkdir(parents=True, exist_ok=True)
    batch = BatchFolder(folder / "out")
    keep_plan(batch, stored(small_plan(folder, more)))
    return batch


def files(folder: Path) -> dict[str, bytes]:
    """Files of a finished scene but for its times."""
    return {name: content for name, content in contents(folder).items() if name != "times.json"}
