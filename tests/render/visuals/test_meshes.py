"""Meshes and height fields of a model."""

import mujoco
import numpy as np
from textured import textured_model

from ripple_sim.render.contract import MappingKind
from ripple_sim.render.visuals import shapes
from ripple_sim.render.visuals.texture_mapping import mapping_of
from ripple_sim.render.visuals.visual import geom_visual


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
