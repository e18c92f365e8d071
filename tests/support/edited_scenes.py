"""Edits of a scene between `update_scene` and `render`, which both renderers draw.

As a program it draws them with `mujoco.Renderer`, which takes over the process's OpenGL context, to
an .npz file.
"""

import sys

import mujoco
import numpy as np
from mujoco_models import posed

SIZE = (96, 128)  # height, width
FLOOR, TARGET, BOX, LINK = range(4)  # entries of the scene
GEOM = int(mujoco.mjtObj.mjOBJ_GEOM)
DYNAMIC = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
_MODEL = """<mujoco><visual><quality numslices="128" numstacks="64"/></visual>
<asset><mesh name="tet" vertex="0 0 0 .8 0 0 0 .8 0 0 0 .8"/></asset><worldbody>
<light pos="0 -1 4" dir="0 .2 -1" diffuse=".6 .6 .6"/>
<camera name="c" pos="0 -6 3" xyaxes="1 0 0 0 .45 1"/>
<geom name="floor" type="plane" size="5 5 .1"/>
<geom name="target" size=".4" pos="1 0 .5" rgba=".7 .2 .2 1"/>
<body name="link" pos="-1 0 .5"><freejoint/><geom type="mesh" mesh="tet" rgba=".2 .7 .2 1"/></body>
<geom name="box" type="box" size=".2 .3 .2" pos="0 1 .4" rgba=".2 .3 .8 1"/></worldbody></mujoco>"""


def state() -> tuple[mujoco.MjModel, mujoco.MjData]:
    return posed(_MODEL)


def ghost(scene: mujoco.MjvScene) -> None:
    model, data = state()
    data.qpos[:2] += 0.5, -2
    mujoco.mj_forward(model, data)
    mujoco.mjv_addGeoms(model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), DYNAMIC, scene)
    scene.geoms[scene.ngeom - 1].rgba[3] = 0.6


def moved(scene: mujoco.MjvScene) -> None:
    scene.geoms[LINK].pos = [0, -1, 1.5]
    scene.geoms[BOX].mat = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]


def target_moved(scene: mujoco.MjvScene) -> None:
    scene.geoms[TARGET].pos = [0.5, -1, 1.2]


def other_shapes(scene: mujoco.MjvScene) -> None:
    scene.geoms[BOX].size = [0.6, 0.1, 0.5]
    scene.geoms[LINK].type = mujoco.mjtGeom.mjGEOM_ELLIPSOID
    scene.geoms[LINK].size = [0.2, 0.4, 0.6]


def taken_away(scene: mujoco.MjvScene) -> None:
    scene.ngeom = TARGET


def added(scene: mujoco.MjvScene) -> None:
    arrow, mesh = scene.geoms[scene.ngeom : scene.ngeom + 2]
    rgba = np.array([1, 0, 1, 1], np.float32)
    zero = np.zeros(3)
    turn = np.eye(3).ravel()
    mujoco.mjv_initGeom(arrow, mujoco.mjtGeom.mjGEOM_ARROW, zero, zero, turn, rgba)
    mujoco.mjv_connector(
        arrow,
        mujoco.mjtGeom.mjGEOM_ARROW,
        0.1,
        np.array([-2.0, -1, 0.5]),
        np.array([-1.0, -1, 2.5]),
    )
    mujoco.mjv_initGeom(
        mesh, mujoco.mjtGeom.mjGEOM_MESH, zero, np.array([1.5, -1.5, 1]), turn, rgba
    )
    mesh.dataid = 0
    for number, each in enumerate((arrow, mesh)):
        each.category = DYNAMIC
        each.segid = scene.ngeom + number
        each.objtype = mujoco.mjtObj.mjOBJ_UNKNOWN
        each.objid = 70 + number
    scene.ngeom += 2


def lines(scene: mujoco.MjvScene) -> None:
    """Lines that are as far at both ends, the edges of a box, and triangles from both sides."""
    kinds = mujoco.mjtGeom
    turn = np.eye(3)
    slanted = turn.copy()
    slanted[:, 2] = np.array([1.5, 0.45, 1]) / np.linalg.norm([1.5, 0.45, 1])
    entries = (
        (kinds.mjGEOM_LINE, [6, 6, 4.5], [-1.5, -1, 0.4], turn[:, [1, 2, 0]], [1, 0, 0]),
        (kinds.mjGEOM_LINE, [8, 8, 3], [0.2, -3, 0.3], slanted, [0, 1, 0]),
        (kinds.mjGEOM_LINEBOX, [1.6, 0.5, 0.4], [0, -1, 1.6], turn, [0, 0, 1]),
        (kinds.mjGEOM_TRIANGLE, [1.5, 2, 0], [-2, -1.5, 1.5], turn, [1, 1, 0]),
        (kinds.mjGEOM_TRIANGLE, [1, 1.5, 0], [2.5, 1, 2], turn * [-1, -1, 1], [1, 0, 1]),
        (kinds.mjGEOM_TRIANGLE, [1, 2, 0], [0, 1, 2], turn * [1, -1, -1], [0, 1, 1]),
    )
    for number, (kind, size, place, rotation, color) in enumerate(entries):
        entry = scene.geoms[scene.ngeom]
        rgba = np.array([*color, 1], np.float32)
        mujoco.mjv_initGeom(entry, kind, np.array(size), np.array(place), rotation.ravel(), rgba)
        entry.category = DYNAMIC
        entry.segid = scene.ngeom
        entry.objtype = mujoco.mjtObj.mjOBJ_UNKNOWN
        entry.objid = 80 + number
        scene.ngeom += 1


def camera_moved(scene: mujoco.MjvScene) -> None:
    for camera in scene.camera:
        camera.pos = np.add(camera.pos, (0.7, 1, 0.2))
        camera.frustum_top *= 0.8


def lamp(scene: mujoco.MjvScene) -> None:
    """A red spot from above the empty middle of the floor."""
    light = scene.lights[scene.nlight]
    light.type = mujoco.mjtLightType.mjLIGHT_SPOT
    light.pos = [-1, -1, 4]
    light.dir = [0, 0, -1]
    light.diffuse = [1, 0, 0]
    light.attenuation = [1, 0, 0]
    light.cutoff = 30
    light.exponent = 1
    light.ambient = [0, 0, 0]
    light.specular = [0.3, 0.3, 0.3]
    light.castshadow = 1
    light.headlight = 0
    scene.nlight += 1


EDITS = {
    edit.__name__: edit
    for edit in (ghost, moved, target_moved, other_shapes, taken_away, added, lines, camera_moved)
}


def drawn(renderer: mujoco.Renderer, data: mujoco.MjData, name: str) -> dict[str, np.ndarray]:
    """Depth, segmentation and colours of the edited scene, and colours of the scene as it was."""
    renderer.update_scene(data, "c")
    images = {"before": renderer.render()}
    EDITS[name](renderer.scene)
    images["after"] = renderer.render()
    renderer.enable_depth_rendering()
    images["depth"] = renderer.render()
    renderer.disable_depth_rendering()
    renderer.enable_segmentation_rendering()
    images["segmentation"] = renderer.render()
    renderer.disable_segmentation_rendering()
    return images


if __name__ == "__main__":
    found = {}
    model, data = state()
    with mujoco.Renderer(model, *SIZE) as renderer:
        for name in EDITS:
            found |= {
                f"{name} {kind}": image for kind, image in drawn(renderer, data, name).items()
            }
    np.savez(sys.argv[1], **found)
