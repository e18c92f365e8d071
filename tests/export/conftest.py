"""A rippling egg under a stone, and a run of it in a loop of its own."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import pytest
from chromium import launched
from scene_files import write_scene

from ripple_sim import Material, Ripples, Scene, load_scene

MJCF = """<mujoco><option timestep="0.001"/>
<asset><texture name="tiles" type="2d" builtin="checker" width="8" height="8"/>
<material name="tiles" texture="tiles" texrepeat="4 4"/></asset>
<worldbody><light pos="1 0 2" dir="-1 0 -2" type="spot" specular=".1 .1 .1"/>
<camera name="side" pos="0 -2 0.5" xyaxes="1 0 0 0 0.2 1" fovy="40"/>
<geom name="floor" type="plane" size="2 2 .1" pos="0 0 -0.4" material="tiles"/>
<body name="nest" pos="0.1 0 0" euler="0 0 30">
<geom name="egg" type="ellipsoid" size="0.3 0.25 0.2"/></body>
<body name="stone" pos="0.15 0 0.245"><freejoint/><geom name="stone" size="0.05" rgba="1 0 0 1"/>
</body>
</worldbody></mujoco>"""

SOFT = """<mujoco><option timestep="0.002" solver="CG"/><worldbody>
<body name="nest" pos="0.1 0 0.6" euler="0 0 30">
<geom name="egg" type="ellipsoid" size="0.3 0.25 0.2"/></body>
<flexcomp name="jelly" type="grid" count="3 3 3" spacing=".1 .1 .1" pos="1 0 .2" dim="3"
  radius=".005" dof="trilinear"
  mass="2"><contact selfcollide="none"/><elasticity young="4e3" poisson=".3" damping=".02"/>
  </flexcomp>
<geom type="plane" size="3 3 .1" pos="0 0 .09"/></worldbody></mujoco>"""

TOML = """model = "scene.xml"
duration = 0.05
[[ripple]]
geom = "egg"
resolution = 12
material = {speed = 0.3, density = 1500.0}
"""


@pytest.fixture(scope="session")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("scene"), MJCF, TOML)


@pytest.fixture(scope="session")
def scene(scene_file: Path) -> Scene:
    return load_scene(scene_file)


@pytest.fixture(scope="module")
def ripples() -> Ripples:
    model = mujoco.MjModel.from_xml_string(MJCF)
    return Ripples(
        model, {"egg": Material(speed=0.3, density=1500.0)}, resolution=12, backend="cpu"
    )


@pytest.fixture
def soft_model() -> mujoco.MjModel:
    """An egg, and a soft body that falls."""
    return mujoco.MjModel.from_xml_string(SOFT)


@pytest.fixture(scope="module")  # a process has one at a time
def browser() -> Iterator[Any]:
    with launched("--use-angle=swiftshader", "--enable-unsafe-swiftshader") as made:
        yield made
