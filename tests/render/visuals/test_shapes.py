"""Shapes of geoms, meshes and height fields have MuJoCo's sizes and areas, and are closed."""

import mujoco
import numpy as np
import pytest
from textured import textured_model

from ripple_sim.render import MappingKind
from ripple_sim.render.visuals import geom_visual, mapping_of, shape_of, shapes, sizes


def drawn(geom: str, segments: int = 22):
    """Model, and the shape of its only geom with the sizes that its vertices depend on."""
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><geom {geom}/></worldbody></mujoco>"
    )
    visual = geom_visual(model, 0)
    _, make = shape_of(model, visual)
    return model, make(segments), *sizes(model, visual)


def ellipsoid_area(a: float, b: float, c: float) -> float:
    theta, phi = np.meshgrid(
        (np.arange(400) + 0.5) * np.pi / 400, (np.arange(400) + 0.5) * np.pi / 200
    )
    x = np.sin(theta) * np.cos(phi)
    y = np.sin(theta) * np.sin(phi)
    z = np.cos(theta)
    stretch = np.sqrt((b * c * x) ** 2 + (a * c * y) ** 2 + (a * b * z) ** 2)
    return float((stretch * np.sin(theta)).sum() * np.pi / 400 * np.pi / 200)


@pytest.mark.parametrize(
    ("geom", "half", "volume", "area"),
    [
        ('type="sphere" size=".3"', [0.3] * 3, 4 / 3 * np.pi * 0.027, 4 * np.pi * 0.09),
        (
            'type="ellipsoid" size=".3 .2 .1"',
            [0.3, 0.2, 0.1],
            4 / 3 * np.pi * 0.006,
            ellipsoid_area(0.3, 0.2, 0.1),
        ),
        (
            'type="capsule" size=".1 .4"',
            [0.1, 0.1, 0.5],
            np.pi * 0.01 * (0.8 + 0.4 / 3),
            2 * np.pi * 0.1 * (0.2 + 0.8),
        ),
        (
            'type="cylinder" size=".2 .4"',
            [0.2, 0.2, 0.4],
            np.pi * 0.04 * 0.8,
            2 * np.pi * 0.2 * (0.2 + 0.8),
        ),
        ('type="box" size=".1 .2 .3"', [0.1, 0.2, 0.3], 0.048, 8 * (0.02 + 0.06 + 0.03)),
    ],
)
@pytest.mark.parametrize("segments", [4, 22])
def test_a_primitive_is_closed_and_has_its_sizes_its_volume_and_its_area(
    geom, half, volume, area, segments
):
    """Edges of a box and rims of a cylinder are a little rounded; sharp ones have their area."""
    _, shape, core, shell = drawn(geom, segments)
    V = shape.positions(core, shell)
    F = shape.faces
    normals = shape.normals / shell
    np.testing.assert_allclose(V.max(axis=0), half, atol=1e-9)
    np.testing.assert_allclose(V.min(axis=0), np.negative(half), atol=1e-9)
    enclosed = np.einsum("fi,fi->f", V[F[:, 0]], np.cross(V[F[:, 1]], V[F[:, 2]])).sum() / 6
    assert enclosed == pytest.approx(volume, rel=0.08 if segments == 4 else 0.01)
    assert enclosed < volume  # vertices lie on the surface
    edges = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    directed, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() == 1
    np.testing.assert_array_equal(directed, np.unique(edges[:, ::-1], axis=0))
    # triangles face outwards, and their vertices' own normals lean to that side
    cross = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    assert np.einsum("ij,ij->i", cross, V[F].mean(axis=1)).min() > -1e-15
    assert np.einsum("ij,ij->i", cross, normals[F].sum(axis=1)).min() > -1e-15
    if "box" in geom or "cylinder" in geom:
        V = shape.positions(core + 0.99 * shell, 0.01 * shell)
        cross = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    assert np.linalg.norm(cross, axis=1).sum() / 2 == pytest.approx(
        area, rel=0.04 if segments == 4 else 0.01
    )


def test_a_plane_has_its_size_and_an_endless_plane_is_far_larger_than_the_model():
    for size, reach in (("2 3", [2, 3, 0]), ("0 3", [np.inf, 3, 0])):
        model, shape, core, shell = drawn(f'type="plane" size="{size} .1"')
        V = np.abs(shape.positions(core, shell)).max(axis=0)
        np.testing.assert_allclose(
            np.where(50 * model.stat.extent > V, V, np.inf), reach, atol=1e-6
        )


def test_a_height_field_has_the_heights_and_the_base_of_the_model():
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
    V = shape.shell
    F = shape.faces
    cross = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    outwards = V[F].mean(axis=1) - [0, 0, 0.1]
    assert np.einsum("ij,ij->i", cross, outwards).min() > 0


def test_a_mesh_keeps_its_texture_coordinates():
    mesh = (
        '<mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1" texcoord="0 0 1 0 0 1 1 1" face="0 2 '
        "1 "
        '0 1 3 0 3 2 1 2 3"/>'
    )
    model = textured_model(
        '<geom type="mesh" mesh="m" material="m"/>', 'texrepeat="3 2"', asset=mesh
    )
    mapping = mapping_of(model, geom_visual(model, 0))
    assert (mapping.kind, mapping.own, mapping.tiling) == (
        MappingKind.FLAT_IMAGE,
        True,
        (3.0, 2.0, 0.0, 0.0),
    )
    shape = shapes.mesh_asset(model, 0)
    assert {tuple(uv) for uv in shape.uv} == {(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)}
