"""The image on a target arrives in MuJoCo's model, the right way up."""

import mujoco
import numpy as np
import pytest
import trimesh
from PIL import Image

from ripple_sim.errors import SceneError
from ripple_sim.scene.drop import paint_target
from ripple_sim.solver import Mesh, load_mesh

PIXELS = np.random.default_rng(0).integers(0, 256, (3, 5, 3), dtype=np.uint8)


def textured_cube(folder) -> tuple[mujoco.MjSpec, Mesh]:
    """A cube whose texture coordinates are its x and z, and a model with it as its target."""
    V, F = trimesh.creation.box(extents=(1, 1, 1)).vertices + 0.5, trimesh.creation.box().faces
    lines = [f"v {x} {y} {z}" for x, y, z in V] + [f"vt {x} {z}" for x, _, z in V]
    lines += ["f " + " ".join(f"{i + 1}/{i + 1}" for i in face) for face in F]
    (folder / "cube.obj").write_text("\n".join(lines))
    mesh, spec = load_mesh(folder / "cube.obj"), mujoco.MjSpec()
    spec.add_mesh(name="target", uservert=mesh.V.ravel(), userface=mesh.F.ravel())
    spec.worldbody.add_geom(name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="target")
    return spec, mesh


def test_the_image_reaches_the_model_bit_for_bit(tmp_path) -> None:
    spec, mesh = textured_cube(tmp_path)
    Image.fromarray(PIXELS).save(tmp_path / "image.png")
    paint_target(spec, mesh, tmp_path / "cube.obj", tmp_path / "image.png")
    model = spec.compile()
    assert (model.tex_height[0], model.tex_width[0], model.tex_nchannel[0]) == PIXELS.shape
    np.testing.assert_array_equal(model.tex_data.reshape(PIXELS.shape), PIXELS)
    material = model.geom("target").matid[0]
    assert model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB] == model.texture("target").id


def test_mujoco_counts_v_from_the_upper_edge_of_the_image(tmp_path) -> None:
    spec, mesh = textured_cube(tmp_path)
    Image.fromarray(PIXELS).save(tmp_path / "image.png")
    paint_target(spec, mesh, tmp_path / "cube.obj", tmp_path / "image.png")
    model = spec.compile()
    corners = model.mesh_texcoord[model.mesh_facetexcoord]
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.mesh_quat[0])
    V = model.mesh_vert @ rotation.reshape(3, 3).T + model.mesh_pos[0]
    places = V[model.mesh_face]
    np.testing.assert_allclose(corners[..., 0], places[..., 0], atol=1e-6)
    np.testing.assert_allclose(corners[..., 1], 1 - places[..., 2], atol=1e-6)


def test_an_image_beside_the_mesh_is_used_unless_another_is_asked_for(tmp_path) -> None:
    Image.fromarray(PIXELS).save(tmp_path / "cube_texture.png")
    Image.fromarray(255 - PIXELS).save(tmp_path / "other.png")
    for texture, expected in ((None, PIXELS), (tmp_path / "other.png", 255 - PIXELS)):
        spec, mesh = textured_cube(tmp_path)
        paint_target(spec, mesh, tmp_path / "cube.obj", texture)
        np.testing.assert_array_equal(spec.compile().tex_data.reshape(PIXELS.shape), expected)


def test_without_an_image_or_without_coordinates_the_model_stays_plain(tmp_path) -> None:
    spec, mesh = textured_cube(tmp_path)
    paint_target(spec, mesh, tmp_path / "cube.obj", None)
    assert spec.compile().ntex == 0
    bare = Mesh.from_arrays(mesh.V, mesh.F)
    Image.fromarray(PIXELS).save(tmp_path / "cube_texture.png")
    paint_target(spec, bare, tmp_path / "cube.obj", None)
    assert spec.compile().ntex == 0
    with pytest.raises(SceneError, match=r"cannot be shown on '.*cube.obj', which has no texture coordinates: choose"):
        paint_target(spec, bare, tmp_path / "cube.obj", tmp_path / "cube_texture.png")
