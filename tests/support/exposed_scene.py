"""A body that flies past a target, before a camera with a shutter and a lens."""

import numpy as np

FPS = 30
WIDTH = 240
HEIGHT = 120
DISTANCE = 2.0
FOVY = 40.0
SPEED = 18.0
MJCF = """<mujoco><option gravity="0 0 0" timestep="0.002"/><worldbody>
<geom name="egg" type="sphere" size="0.05"/>{bodies}</worldbody></mujoco>"""

SHOT = (
    '<body name="shot" pos="0 0.9 0.3"><freejoint/><geom size="0.05" contype="0" '
    'conaffinity="0"/></body>'
)
TOML = f"""model = "scene.xml"
duration = 0.2
lighting = "studio"
[camera]
lookat = [0, 0, 0]
distance = {DISTANCE}
azimuth = 0
elevation = 0
fovy = {FOVY}
[[ripple]]
geom = "egg"
resolution = 16
material = {{speed = 0.5, density = 20.0}}
"""
THROW = f"""[[throw]]
body = "shot"
time = 0.0
velocity = [0, {-SPEED}, 0]
"""


def linear(codes: np.ndarray) -> np.ndarray:
    """Light of sRGB values from 0 to 255."""
    share = codes / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
