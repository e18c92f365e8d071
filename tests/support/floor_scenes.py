"""A rippling ball on three kinds of floor, for comparing OpenGL versions and drivers."""

from collections.abc import Iterator

import numpy as np
from mujoco_models import posed
from numpy.typing import NDArray

from ripple_sim import Camera
from ripple_sim.render import Renderer, Surface
from ripple_sim.render.surfaces import Charts
from ripple_sim.solver import HeightMap, sphere_atlas
from ripple_sim.solver.gl import shared_context

MODEL = """<mujoco>
  <asset>
    <texture name="sky" type="{sky}" builtin="gradient" rgb1=".3 .5 .7" rgb2="0 0 0" width="16"
      height="96"/>
    <texture name="dice" type="cube" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="32"
      height="192"/>
    <material name="dice" texture="dice"/>
    <material name="floor" reflectance="{reflectance}"/>
  </asset>
  <worldbody>
    <light pos="1 1 3" dir="-1 -1 -3"/>
    <geom type="plane" size="3 3 .1" material="floor"/>
    <geom type="sphere" size=".5" pos="0 0 .5"/>
    <geom type="sphere" size=".2" pos=".5 .4 .2" material="dice"/>
  </worldbody>
</mujoco>"""


def floor_frames() -> Iterator[NDArray]:
    """Frames and surface images of a rippling ball on three kinds of floor."""
    atlas = sphere_atlas(0.5, 24)
    heights = 0.02 * np.sin(20 * atlas.positions[..., 0] + 9 * atlas.positions[..., 2])
    height_map = HeightMap(atlas.texels)(heights.astype(np.float32))
    camera = Camera((0.0, 0.0, 0.4), 2.4, 60.0, -20.0)
    for look, sky, reflectance in (
        ("rubber", "2d", 0.0),
        ("water", "2d", 0.0),
        ("model", "skybox", 0.4),
    ):
        model, data = posed(MODEL.format(sky=sky, reflectance=reflectance))
        surface = Surface(atlas.mesh.V, atlas.mesh.F, Charts.of(atlas), look)
        with Renderer(shared_context(), model, {1: surface}, size=(200, 160)) as renderer:
            yield renderer.render(data, {1: height_map}, camera)
            image = renderer.surfaces(data, {1: height_map}, camera)
            yield np.concatenate(
                [image.depth[..., None], image.normal, image.height[..., None]], axis=2
            )
