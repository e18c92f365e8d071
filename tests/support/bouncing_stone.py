"""A stone that falls on an egg, bounces, and falls again, before a camera."""

MJCF = """<mujoco><option timestep="0.002"/><default><geom solref="0.01 0.3"/></default><worldbody>
<geom name="floor" type="plane" size="2 2 1" pos="0 0 -0.3"/>
<geom name="egg" type="ellipsoid" size="0.3 0.25 0.2"/>
<body name="stone" pos="0.05 0 0.3"><freejoint/><geom name="stone" size="0.05"/></body></worldbody>
</mujoco>"""
TOML = """model = "scene.xml"
duration = 0.5
[camera]
lookat = [0, 0, 0]
distance = 1.6
elevation = -30
[[ripple]]
geom = "egg"
resolution = 24
material = {speed = 0.5, density = 20.0}
"""
