"""The picture of a mesh file is found and reaches the film."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from PIL import Image

from ripple_sim.capture.frame_source import FrameSource
from ripple_sim.capture.snapshot import snapshots
from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.scene.drop import drop_scene, mesh_image
from ripple_sim.scenes.shapes import peanut, write_obj
from ripple_sim.simulation import Simulation
from ripple_sim.solver.errors import GLError

RED, BLUE = (230, 20, 20), (20, 20, 230)


def half_and_half(path: Path) -> Path:
    """A picture that is red in its upper half and blue in its lower one."""
    picture = np.full((16, 16, 3), BLUE, dtype=np.uint8)
    picture[:8] = RED
    Image.fromarray(picture).save(path)
    return path


def textured_obj(path: Path, head: str = "", before_faces: str = "") -> Path:
    """A peanut whose v is its height from 0 to 1; y is up, as is usual in OBJ files."""
    V, F = peanut()
    lines = [head, *(f"v {x} {y} {z}" for x, y, z in V)]
    lines += [f"vt 0.5 {v}" for v in (V[:, 1] - V[:, 1].min()) / np.ptp(V[:, 1])]
    lines += [before_faces, *("f " + " ".join(f"{i + 1}/{i + 1}" for i in face) for face in F)]
    path.write_text("\n".join(lines))
    return path


def test_the_picture_is_named_by_the_material_library(tmp_path):
    half_and_half(tmp_path / "coat of paint.png")
    (tmp_path / "p.mtl").write_text(
        "newmtl other\nmap_Kd slot_scratch.png\nnewmtl skin\nKd 1 1 1\nmap_Kd coat of paint.png\n"
    )
    mesh = textured_obj(tmp_path / "p.obj", "mtllib p.mtl", "usemtl skin")
    picture = mesh_image(mesh)
    assert tuple(picture[0, 0]) == RED
    assert tuple(picture[-1, 0]) == BLUE


def test_without_a_library_a_picture_beside_it_serves(tmp_path):
    mesh = textured_obj(tmp_path / "p.obj")
    assert mesh_image(mesh) is None
    half_and_half(tmp_path / "p_texture.png")
    assert mesh_image(mesh).shape == (16, 16, 3)


def test_two_images_are_not_mixed_up(tmp_path):
    for name in ("a", "b"):
        half_and_half(tmp_path / f"{name}.png")
    (tmp_path / "p.mtl").write_text("newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\n")
    mesh = textured_obj(tmp_path / "p.obj", "mtllib p.mtl", "usemtl a\nusemtl b")
    with pytest.warns(RippleWarning, match="2 images.*--texture"):
        assert mesh_image(mesh) is None


def test_the_image_of_a_glb_is_inside_it(tmp_path):
    V, F = peanut()
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.open(half_and_half(tmp_path / "x.png")))
    visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(V), 2)), material=material)
    trimesh.Trimesh(V, F, visual=visual, process=False).export(tmp_path / "p.glb")
    assert tuple(mesh_image(tmp_path / "p.glb")[0, 0]) == RED


@pytest.mark.parametrize("named", [True, False])
def test_a_dropped_on_mesh_wears_its_image(tmp_path, named):
    """Red above and blue below, in the film and in the model that MuJoCo would draw."""
    mesh = textured_obj(tmp_path / "p.obj")
    half_and_half(tmp_path / ("p_texture.png" if named else "paint.png"))
    scene = drop_scene(mesh, bodies=0, texture=None if named else tmp_path / "paint.png")
    model = scene.model
    assert model.mat_texid[model.geom("target").matid[0], mujoco.mjtTextureRole.mjTEXROLE_RGB] == 0
    simulation = Simulation(scene, fps=10, resolution=16, backend="cpu")
    try:
        source = FrameSource(simulation, width=96, height=72)
    except GLError as error:
        pytest.skip(f"no OpenGL context: {error}")
    frame = source.render(next(iter(snapshots(simulation, 1)))).astype(int)
    redder = frame[..., 0] - frame[..., 2]
    rows = np.arange(72)[:, None]
    assert (redder > 60).sum() > 100
    assert (redder < -60).sum() > 100
    assert np.median(np.where(redder > 60, rows, np.nan)[redder > 60]) < np.median(
        np.where(redder < -60, rows, np.nan)[redder < -60]
    )


def test_an_image_that_cannot_be_shown_is_refused(tmp_path):
    bare, textured = tmp_path / "bare.obj", textured_obj(tmp_path / "p.obj")
    write_obj(bare, *peanut())
    paint = half_and_half(tmp_path / "paint.png")
    with pytest.raises(SceneError, match=r"paint\.png.*no texture coordinates"):
        drop_scene(bare, texture=paint)
    (tmp_path / "broken.png").write_bytes(b"no picture")
    with pytest.raises(SceneError, match=r"broken\.png.*cannot be read"):
        drop_scene(textured, texture=tmp_path / "broken.png")
