"""Surfaces with a rim are seen from both sides."""

import mujoco
import numpy as np
from drawn import ball_surface
from hand_made import RIM, flat_charts

from ripple_sim.render import Camera, Renderer, Surface
from ripple_sim.render.surfaces.surface import Charts
from ripple_sim.solver import TexelMesh, texel_atlas
from ripple_sim.solver.waves.height_map import HeightMap

N = 24
CORNERS = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
MODEL = """<mujoco><worldbody>
  <light directional="true" pos="0 0 3" dir=".4 .2 {}" diffuse=".8 .8 .8" castshadow="true"/>
  <geom name="sheet" type="sphere" size="1"/>
  <geom type="sphere" size=".2" pos=".3 .1 {}" rgba=".8 .2 .2 1"/>
</worldbody></mujoco>"""


def sheet(turned: bool) -> TexelMesh:
    """A square that faces up, or the same turned to face down."""
    return flat_charts([CORNERS[[0, 3, 2, 1]] if turned else CORNERS], [[RIM] * 4], N)


def picture(gl, turned: bool, above: bool) -> np.ndarray:
    """Frame of a bump under a lamp and a ball that are above or below the sheet, as is the camera."""
    side = 1 if above else -1
    model = mujoco.MjModel.from_xml_string(MODEL.format(-side, 0.6 * side))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    texels = sheet(turned)
    x, y, _ = np.moveaxis(texels.positions, -1, 0)
    bump = 0.2 * np.exp(-((x + 0.3) ** 2 + y**2) / 0.1)
    height = (-bump if turned else bump).astype(np.float32)
    atlas = texel_atlas(texels)
    surface = Surface(atlas.mesh.V, atlas.mesh.F, Charts.of(atlas), "rubber")
    camera = Camera((0.0, 0.0, 0.0), 4.0, 90.0, -50.0 * side, 40.0)
    with Renderer(gl, model, {0: surface}, size=(160, 120), samples=4) as renderer:
        return renderer.render(data, {0: HeightMap(texels)(height)}, camera).astype(int)


def test_a_sheet_looks_the_same_whichever_way_its_triangles_are_wound(gl):
    """From above and from below: shape, light, shadow of the ball and ambient occlusion."""
    for above in (True, False):
        one, turned = (picture(gl, each, above) for each in (False, True))
        assert np.ptp(one[40:80, 50:110]) > 60  # the bump and the shadow show
        assert np.abs(one - turned).mean() < 0.5
        assert (np.abs(one - turned).max(axis=2) > 12).mean() < 0.002


def test_only_a_surface_with_a_rim_is_open(gl):
    texels = texel_atlas(sheet(False))
    assert Surface(texels.mesh.V, texels.mesh.F, Charts.of(texels)).open
    assert not ball_surface("rubber").open
