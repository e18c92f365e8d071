"""Models whose depth and segmentation MuJoCo's own renderer and ours both draw.

As a program it draws them with `mujoco.Renderer`, which takes over the process's OpenGL context, to
an .npz file.
"""

import sys

import mujoco
import numpy as np
from mujoco_models import posed

flag = mujoco.mjtVisFlag
SIZE = (96, 128)  # height, width
_FINE = '<visual><quality numslices="128" numstacks="64"/></visual>'
_CORNERS = "0 0 0  .4 0 0  0 .4 0  0 0 .4  .3 .3 .3"
_BUMPS = " ".join(f"{(3 * i + 5 * j) % 7 / 7:.2f}" for i in range(8) for j in range(8))
_TARGET = '<geom name="target" type="sphere" size=".12" pos="-.5 .4 .4"/>'

WORLDS = {
    "boxes": """<geom type="box" size=".3 .2 .1" euler="20 30 40"/>
        <geom type="box" size=".1 .4 .1" pos=".5 .2 .3" rgba="1 0 0 .4"/>""",
    "spheres": """<geom size=".3"/><geom size=".1" pos=".4 0 .2"/>""",
    "capsules": """<geom type="capsule" size=".1 .3" euler="40 20 0"/>
        <geom type="capsule" fromto="0 .4 0 .5 .4 .3" size=".05"/>""",
    "cylinders": """<geom type="cylinder" size=".2 .1" euler="30 20 0"/>
        <geom type="cylinder" size=".05 .4" pos=".4 0 0"/>""",
    "ellipsoids": """<geom type="ellipsoid" size=".1 .2 .4" euler="30 40 0"/>
        <geom type="ellipsoid" size=".3 .1 .1" pos=".3 .3 .2"/>""",
    "meshes": """<geom type="mesh" mesh="rock" euler="10 20 30"/>
        <geom type="mesh" mesh="rock" pos="-.3 -.3 .3" rgba="0 1 0 .5"/>""",
    "height field": """<geom type="hfield" hfield="hills"/><geom size=".1" pos="0 0 .3"/>""",
    "planes": """<geom type="plane" size="0 0 1" pos="0 0 -.2"/>
    <geom type="plane" size=".3 .2 1" pos=".3 0 .3"
        euler="0 30 0"/>""",
    "planes from behind": """<geom type="plane" size="2 2 1" pos="0 0 2"/>
    <geom type="plane" size=".5 .6 1"
        euler="180 0 0"/>
        <geom type="plane" size=".3 .4 1" pos="-.4 .4 .3" euler="70 0 40" rgba="1 0 0 .4"/>
        <geom size=".2" pos="0 0 -.3"/>""",
    "sites and tendons": """<site name="a" type="box" size=".1 .1 .1" pos="-.3 0 0"/>
        <site name="hidden" size=".3" group="4"/>
        <body pos=".3 0 .2"><freejoint/><geom size=".05"/>
        <site name="b" type="capsule" size=".03 .1"/></body>""",
    "flex and skin": """<flexcomp name="cloth" type="grid" count="5 5 1" spacing=".1 .1 .1"
      dim="2" radius=".001"
        pos="0 0 .2"><edge equality="true"/></flexcomp>""",
    "edges and vertices of a flex": """<flexcomp name="cloth" type="grid" count="4 4 1"
      spacing=".15 .15 .1" dim="2"
        radius=".03" pos="0 0 .2" euler="20 0 0"><edge equality="true"/></flexcomp>""",
    "contacts and joints": """<geom type="plane" size="1 1 1"/><body pos="0 0 .099"><freejoint/>
        <geom type="box" size=".1 .1 .1"/></body>
        <body pos=".5 0 .5"><joint/><geom type="capsule" size=".03 .1"/></body>""",
}
_SEVERAL = """<geom type="plane" size="0 0 1" pos="0 0 -.2"/>
<geom type="box" size=".3 .2 .1" euler="20 30 40"/>
    <geom size=".2" pos=".4 .2 .2"/>
    <geom type="capsule" size=".05 .2" pos="0 -.4 .1" euler="30 60 0"/>"""
_SENSOR = 'resolution="128 96" sensorsize="8e-3 6e-3"'
_SHALLOW = '<statistic extent="1"/><visual><map znear="1.75" zfar="2.2"/></visual>'
# by world: attributes of its camera, and what else the model says of cameras
CAMERAS = {
    "orthographic camera": ('projection="orthographic" fovy="1.6"', ""),
    "camera off its centre": (f'{_SENSOR} focal="6e-3 6e-3" principal="1e-3 .5e-3"', ""),
    "camera with two focal lengths": (f'{_SENSOR} focal="4e-3 7e-3"', ""),
    "camera with near clip planes": ('fovy="50"', _SHALLOW),
    "orthographic camera with near clip planes": ('projection="orthographic" fovy="1.6"', _SHALLOW),
    "camera with a very near clip plane": (
        'fovy="50"',
        '<visual><map znear="2e-4" zfar="3"/></visual>',
    ),
    "orthographic free camera": ("", '<visual><global orthographic="true" fovy="2.5"/></visual>'),
}
WORLDS |= dict.fromkeys(CAMERAS, _SEVERAL)
_TENDON = '<tendon><spatial width=".02"><site site="a"/><site site="b"/></spatial></tendon>'


# Lights and surroundings of a scene: an MJCF's `<visual>`, skybox and lamp, and the flags of the
# scene that are set.
_STARS = """<texture type="skybox" builtin="gradient" rgb1=".5 .6 .7" rgb2=".1 .2 .3" width="256"
  height="256"
    mark="random" markrgb="1 1 1"/>"""
_LAMP = '<light pos="0 0 6" dir="0 0 -1"/>'
_FOGGY = '<rgba fog=".6 .3 .2 1" haze=".2 .9 .3 1"/><map fogstart="1" fogend="8"/>'
# What stands in place of the usual scene, and where the camera is.
_FROM_BELOW = 'pos="0 -3 -1.5" xyaxes="1 0 0 0 -.5 1"'
_PLANES = {
    "floor from below": (
        '<geom type="plane" size="0 0 1" rgba=".4 .6 .4 1"/><geom size=".4" pos="0 0 .5"/>',
        _FROM_BELOW,
    ),
    "plane from below": (
        '<geom type="plane" size="1 1 1" rgba=".4 .6 .4 1"/><geom size=".4" pos="0 0 .5"/>',
        _FROM_BELOW,
    ),
    "transparent floor": (
        (
            '<geom type="plane" size="0 0 1" rgba=".4 .6 .4 .4"/><geom size=".5" pos="0 0 -.7" '
            'rgba=".9 .8 .1 1"/>'
        ),
        'pos="0 -4 2" xyaxes="1 0 0 0 .6 1"',
    ),
    "transparent ball": (
        """<geom type="plane" size="0 0 1" rgba=".4 .4 .4 1"/>
        <geom size=".6" pos="0 0 .7" rgba=".8 .3 .2 .4"/>
        <geom type="box" size=".9 .1 .9" pos="0 1.5 .9" rgba=".2 .2 .9 1"/>""",
        'pos="0 -4 1.2" xyaxes="1 0 0 0 .2 1"',
    ),
    "table over a floor": (
        """<geom type="plane" size="0 0 1" rgba=".5 .5 .5 1"/>
        <geom type="plane" size=".8 .6 1" pos="0 0 .7" rgba=".9 .1 .1 1"/>
        <geom size=".2" pos="0 0 .9"/>""",
        'pos="0 -4 2" xyaxes="1 0 0 0 .5 1"',
    ),
    "table": (
        (
            '<geom type="plane" size=".8 .6 1" pos="0 0 .7" rgba=".9 .1 .1 1"/><geom size=".2" '
            'pos="0 '
            '0 .9"/>'
        ),
        'pos="0 -4 2" xyaxes="1 0 0 0 .5 1"',
    ),
}
LIT: dict[str, tuple[str, str, str, dict[str, int]]] = {
    "headlight": ("", "", "", {}),
    "red headlight": ('<headlight diffuse="1 0 0" ambient=".1 0 0" specular="0 0 0"/>', "", "", {}),
    "dark headlight": ('<headlight diffuse="0 0 0" ambient="0 0 0" specular="0 0 0"/>', "", "", {}),
    "no light": ('<headlight active="0"/>', "", "", {}),
    "lamp": ("", "", _LAMP, {}),
    "stars": ("", _STARS, _LAMP, {}),
    "no skybox": ("", _STARS, _LAMP, {"SKYBOX": 0}),
    "haze": (_FOGGY, _STARS, _LAMP, {}),
    "no haze": (_FOGGY, _STARS, _LAMP, {"HAZE": 0}),
    "fog": (_FOGGY, _STARS, _LAMP, {"FOG": 1}),
    "no shadow": ("", "", _LAMP, {"SHADOW": 0}),
    "no reflection": ("", "", _LAMP, {"REFLECTION": 0}),
    "lamp under the floor": ("", "", '<light pos="0 0 -3" dir="0 0 1"/>', {}),
    **{name: ("", "", _LAMP, {}) for name in _PLANES},
}


def lit_state(name: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A ball and a box over a floor that mirrors, in one of those lights, or some planes."""
    visual, asset, lamp, _ = LIT[name]
    if name in _PLANES:
        body, camera = _PLANES[name]
        return posed(
            f"<mujoco><worldbody>{lamp}{body}<camera name='side' {camera}/></worldbody></mujoco>"
        )
    return posed(f"""<mujoco><visual>{visual}</visual><asset>{asset}
        <material name="floor" rgba=".4 .5 .4 1" reflectance=".3"/></asset><worldbody>{lamp}
        <geom type="plane" size="0 0 1" material="floor"/>
        <geom size=".4" pos="-.3 0 .5" rgba=".8 .5 .3 1"/>
        <geom type="box" size=".3 .3 .3" pos=".8 .4 .6" rgba=".3 .7 .4 1"/>
        <camera name="side" pos="0 -4 1.2" xyaxes="1 0 0 0 .2 1"/></worldbody></mujoco>""")


def lit_frame(
    renderer: mujoco.Renderer, data: mujoco.MjData, name: str
) -> tuple[np.ndarray, np.ndarray]:
    """Colours and what each pixel shows."""
    renderer.update_scene(data, camera="side")
    usual = renderer.scene.flags.copy()
    for flag, value in LIT[name][3].items():
        renderer.scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = value
    colours = renderer.render()
    renderer.scene.flags[:] = usual
    renderer.enable_segmentation_rendering()
    return colours, renderer.render()


def state_of(name: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A model with a sphere called "target" beside the rest, in its first state."""
    camera, view = CAMERAS.get(name, ('fovy="50"', ""))
    return posed(f"""<mujoco>{_FINE}{view}<asset><mesh name="rock" vertex="{_CORNERS}"/>
        <hfield name="hills" nrow="8" ncol="8" size=".5 .5 .3 .1" elevation="{_BUMPS}"/></asset>
        <worldbody>
        {_TARGET}{WORLDS[name]}<camera name="side" pos="1.2 -1.2 .9"
          xyaxes="1 1 0 -.3 .3 1" {camera}/>
        </worldbody>{_TENDON if "tendon" in name else ""}</mujoco>""")


def drawn(
    renderer: mujoco.Renderer, data: mujoco.MjData, name: str
) -> tuple[np.ndarray, np.ndarray]:
    """Depth and segmentation of a model, by any renderer of that interface."""
    option = mujoco.MjvOption()
    if "contacts" in name:
        shown = (
            flag.mjVIS_CONTACTPOINT,
            flag.mjVIS_CONTACTFORCE,
            flag.mjVIS_JOINT,
            flag.mjVIS_TRANSPARENT,
        )
        option.flags[list(map(int, shown))] = 1
    if "edges" in name:
        option.flags[[int(flag.mjVIS_FLEXVERT), int(flag.mjVIS_FLEXFACE)]] = 1
        option.flags[int(flag.mjVIS_FLEXSKIN)] = 0
    renderer.update_scene(data, camera=-1 if "free" in name else "side", scene_option=option)
    renderer.enable_depth_rendering()
    depth = renderer.render()
    renderer.disable_depth_rendering()
    renderer.enable_segmentation_rendering()
    return depth, renderer.render()


if __name__ == "__main__":
    found = {}
    for name in WORLDS:
        model, data = state_of(name)
        with mujoco.Renderer(model, *SIZE) as renderer:
            found[f"depth {name}"], found[f"segmentation {name}"] = drawn(renderer, data, name)
    for name in LIT:
        model, data = lit_state(name)
        with mujoco.Renderer(model, *SIZE) as renderer:
            found[f"colours {name}"], found[f"shown {name}"] = lit_frame(renderer, data, name)
    np.savez(sys.argv[1], **found)
