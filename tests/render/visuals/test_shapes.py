"""Shapes and sizes of geoms: what is drawn is as large as what MuJoCo says.

Meshes and height fields of a model.

Tessellated primitives against their areas.
"""

import mujoco
import numpy as np
import pytest
from textured import textured_model

from ripple_sim.render.contract import MappingKind
from ripple_sim.render.visuals import shapes
from ripple_sim.render.visuals.shapes import shape_of, sizes
from ripple_sim.render.visuals.texture_mapping import mapping_of
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


def test_height_field_stands_as_high_as_it_says():
    model = mujoco.MjModel.from_xml_string("""<mujoco>
      <asset><hfield name="h" nrow="3" ncol="4" size="2 1 .5 .1"/></asset>
      <worldbody><geom type="hfield" hfield="h"/></worldbody></mujoco>""")
    model.hfield_data[:] = np.linspace(0, 1, 12)
    shape = shapes.height_field(model, 0)
    np.testing.assert_allclose(shape.shell.min(axis=0), [-2, -1, -0.1])
    np.testing.assert_allclose(shape.shell.max(axis=0), [2, 1, 0.5])
    top = shape.shell[shape.shell[:, 2] > -0.05]
    corner = top[np.argmin(top @ [1, 1, 0])]
    np.testing.assert_allclose(corner, [-2, -1, 0], atol=1e-6)
    V, F = shape.shell, shape.faces
    cross = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    outwards = V[F].mean(axis=1) - [0, 0, 0.1]
    assert np.einsum("ij,ij->i", cross, outwards).min() > 0


def test_a_mesh_keeps_its_texture_coordinates():
    mesh = '<mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1" texcoord="0 0 1 0 0 1 1 1" face="0 2 1 0 1 3 0 3 2 1 2 3"/>'
    model = textured_model('<geom type="mesh" mesh="m" material="m"/>', 'texrepeat="3 2"', asset=mesh)
    mapping = mapping_of(model, geom_visual(model, 0))
    assert (mapping.kind, mapping.own, mapping.tiling) == (MappingKind.FLAT_IMAGE, True, (3.0, 2.0, 0.0, 0.0))
    shape = shapes.mesh_asset(model, 0)
    assert {tuple(uv) for uv in shape.uv} == {(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)}


def ellipsoid_area(a: float, b: float, c: float) -> float:
    theta, phi = np.meshgrid((np.arange(400) + 0.5) * np.pi / 400, (np.arange(400) + 0.5) * np.pi / 200)
    x, y, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
    stretch = np.sqrt((b * c * x) ** 2 + (a * c * y) ** 2 + (a * b * z) ** 2)
    return float((stretch * np.sin(theta)).sum() * np.pi / 400 * np.pi / 200)


@pytest.mark.parametrize(
    ("shape", "core", "shell", "area"),
    [
        (shapes.ball(14), [0, 0, 0], [0.5, 0.5, 0.5], np.pi),
        (shapes.ball(14), [0, 0, 0], [0.5, 0.3, 0.2], ellipsoid_area(0.5, 0.3, 0.2)),
        (shapes.capsule(40, 9), [0, 0, 0.4], [0.3, 0.3, 0.3], 4 * np.pi * 0.09 + 2 * np.pi * 0.3 * 0.8),
        (shapes.cylinder(56, 3), [0.299, 0.299, 0.399], [0.001] * 3, 2 * np.pi * 0.09 + 2 * np.pi * 0.3 * 0.8),
        (shapes.box(3), [0.199, 0.299, 0.399], [0.001] * 3, 8 * (0.2 * 0.3 + 0.3 * 0.4 + 0.4 * 0.2)),
    ],
    ids=["sphere", "ellipsoid", "capsule", "cylinder", "box"],
)
def test_primitives_are_closed_face_outwards_and_have_their_area(shape, core, shell, area):
    V, F = shape.positions(np.array(core), np.array(shell)), shape.faces
    edges = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    directed, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() == 1
    np.testing.assert_array_equal(directed, np.unique(edges[:, ::-1], axis=0))
    cross = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    centre = V[F].mean(axis=1)
    assert np.einsum("ij,ij->i", cross, centre).min() > -1e-15
    # the vertices' own normals lean to the outside of their triangles
    normals = shape.normals / np.array(shell)
    assert np.einsum("ij,ij->i", cross, normals[F].sum(axis=1)).min() > -1e-15
    assert np.linalg.norm(cross, axis=1).sum() / 2 == pytest.approx(area, rel=0.01)
