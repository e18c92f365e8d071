"""What tests of interrupted videos share."""

from pathlib import Path


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


MJCF = """<mujoco><option timestep="0.005"/><worldbody><geom name="egg" type="ellipsoid" size="0.3 0.25 0.2"/>
<body name="stone" pos="0.05 0 0.3"><freejoint/><geom name="stone" size="0.05"/></body></worldbody></mujoco>"""


TOML = """model = "scene.xml"
duration = 2.0
[[ripple]]
geom = "egg"
resolution = 12
material = {speed = 0.3, density = 1500.0}
"""
