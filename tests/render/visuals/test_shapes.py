"""Shapes and sizes of geoms: what is drawn is as large as what MuJoCo says."""

import mujoco
import numpy as np
import pytest

from ripple_sim.render.visuals.shapes import shape_of, sizes
from ripple_sim.render.visuals.visual import geom_visual


def drawn(geom: str, segments: int = 22):
    """Model, and vertices and triangles of its only geom."""
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody><geom {geom}/></worldbody></mujoco>")
    visual = geom_visual(model, 0)
    _, make = shape_of(model, visual)
    shape = make(segments)
    return model, shape.positions(*sizes(model, visual)), shape.faces


@pytest.mark.parametrize(
    ("geom", "half", "volume"),
    [
        ('type="sphere" size=".3"', [0.3] * 3, 4 / 3 * np.pi * 0.027),
        ('type="ellipsoid" size=".3 .2 .1"', [0.3, 0.2, 0.1], 4 / 3 * np.pi * 0.006),
        ('type="capsule" size=".1 .4"', [0.1, 0.1, 0.5], np.pi * 0.01 * (0.8 + 4 / 3 * 0.1)),
        ('type="cylinder" size=".2 .4"', [0.2, 0.2, 0.4], np.pi * 0.04 * 0.8),
        ('type="box" size=".1 .2 .3"', [0.1, 0.2, 0.3], 0.048),
    ],
)
@pytest.mark.parametrize("segments", [4, 22])
def test_a_primitive_reaches_as_far_as_its_sizes_and_has_its_volume(geom, half, volume, segments):
    """Edges of a box and rims of a cylinder are rounded a little."""
    _, V, F = drawn(geom, segments)
    np.testing.assert_allclose(V.max(axis=0), half, atol=1e-9)
    np.testing.assert_allclose(V.min(axis=0), np.negative(half), atol=1e-9)
    enclosed = np.einsum("fi,fi->f", V[F[:, 0]], np.cross(V[F[:, 1]], V[F[:, 2]])).sum() / 6
    assert enclosed == pytest.approx(volume, rel=0.08 if segments == 4 else 0.01)
    assert enclosed < volume  # vertices lie on the surface


def test_a_plane_is_as_large_as_it_says_or_far_larger_than_the_model():
    _, V, _ = drawn('type="plane" size="2 3 .1"')
    np.testing.assert_allclose(np.abs(V).max(axis=0), [2, 3, 0], atol=1e-6)
    model, V, _ = drawn('type="plane" size="0 3 .1"')
    assert np.abs(V[:, 0]).max() >= 50 * model.stat.extent
    assert np.abs(V[:, 1]).max() == pytest.approx(3.0)


def test_geoms_of_one_shape_share_its_name_and_meshes_have_one_each():
    tetrahedron = 'vertex="0 0 0 1 0 0 0 1 0 0 0 1"'
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <asset><mesh name="a" {tetrahedron}/><mesh name="b" {tetrahedron}/></asset><worldbody>
      <geom type="sphere" size="1"/><geom type="ellipsoid" size="1 2 3"/><geom type="box" size="1 2 3"/>
      <geom type="mesh" mesh="a"/><geom type="mesh" mesh="b"/><geom type="mesh" mesh="a"/>
      </worldbody></mujoco>""")
    names = [shape_of(model, geom_visual(model, geom))[0] for geom in range(model.ngeom)]
    assert names[0] == names[1] != names[2]
    assert names[3] == names[5] != names[4]
    make = shape_of(model, geom_visual(model, 3))[1]
    assert len(make(4).faces) == len(make(22).faces) == 4
    np.testing.assert_array_equal(sizes(model, geom_visual(model, 3)), [np.zeros(3), np.ones(3)])
