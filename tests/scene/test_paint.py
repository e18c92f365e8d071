"""The looks of a mesh file, packed into one texture of the model."""

import base64
import io
from pathlib import Path

import mujoco
import numpy as np
import pytest
from gltf_files import SQUARE, SQUARE_UV, Gltf, png
from PIL import Image

from ripple_sim.capture import FrameSource, snapshots
from ripple_sim.coupling.colliders import make_collidable
from ripple_sim.export.page_parts import data_uri
from ripple_sim.render.tone_mapping import linear_to_srgb, srgb_to_linear
from ripple_sim.scene import drop_scene, load_scene
from ripple_sim.scene.material_images import MaterialImages, load_image
from ripple_sim.scene.packing import packed
from ripple_sim.scene.paint import paint_target
from ripple_sim.simulation import Simulation
from ripple_sim.solver import Mesh, load_mesh
from ripple_sim.solver.mesh.looks import CLAMP, MIRROR, REPEAT, ImageSource, Looks, Paint

RED = (255, 0, 0)
BLUE = (0, 0, 255)
RNG = np.random.default_rng(0)
PIXELS = RNG.integers(0, 256, (4, 6, 3), dtype=np.uint8)
IMAGE = ImageSource(png(PIXELS), "image")
# two triangles of a square, with texture coordinates
UV = SQUARE_UV[[[0, 1, 2], [0, 2, 3]]] * [1, -1] + [0, 1]


def bilinear(pixels: np.ndarray, place: np.ndarray, index) -> np.ndarray:
    """Linear light between the middles of pixels at a place [pixels]; `index` wraps numbers."""
    low = np.floor(place - 0.5).astype(int)
    share = place - 0.5 - low
    total = np.zeros(3)
    for right in (0, 1):
        for down in (0, 1):
            weight = (share[0] if right else 1 - share[0]) * (share[1] if down else 1 - share[1])
            row = index(low[1] + down, pixels.shape[0])
            column = index(low[0] + right, pixels.shape[1])
            total += weight * srgb_to_linear(pixels[row, column, :3] / 255)
    return total


WRAPS = {
    REPEAT: lambda i, n: i % n,
    CLAMP: lambda i, n: min(max(i, 0), n - 1),
    MIRROR: lambda i, n: i % n if (i // n) % 2 == 0 else n - 1 - i % n,
}


def seen(image, triangle: int, weights: np.ndarray) -> np.ndarray:
    """Linear light that a renderer shows at a point of a triangle."""
    place = weights @ image.uv[triangle] * image.pixels.shape[1::-1]
    return bilinear(image.pixels, place, WRAPS[REPEAT])


def points(count: int = 20) -> np.ndarray:
    return np.random.default_rng(1).dirichlet((1, 1, 1), count)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("shift", [0.0, 0.3, -2.7])
@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_a_packed_image_shows_what_the_sampler_shows(wrap: str, shift: float, scale) -> None:
    """A second material makes the image be packed; a single image would not change."""
    paints = (Paint((0.5, 1, 1, 1), IMAGE, wrap=(wrap, wrap)), Paint((0, 0, 1, 1)))
    uv = np.concatenate([scale * UV + shift, UV])
    image = packed(Looks(paints, np.array([0, 0, 1, 1])), uv, MaterialImages().of)
    for triangle in range(2):
        for weights in points():
            u, v = weights @ uv[triangle]
            truth = bilinear(PIXELS, np.array([6 * u, 4 * (1 - v)]), WRAPS[wrap]) * [0.5, 1, 1]
            np.testing.assert_allclose(seen(image, triangle, weights), truth, atol=0.01)
    for weights in points(5):
        np.testing.assert_allclose(seen(image, 2, weights), [0, 0, 1], atol=1e-9)


def test_a_single_image_that_repeats_stays_bit_for_bit() -> None:
    looks = Looks((Paint(image=IMAGE),), np.zeros(2, np.int64), np.ones((2, 3, 4)))
    image = packed(looks, 3 * UV, MaterialImages().of)
    np.testing.assert_array_equal(image.pixels[..., :3], PIXELS)
    np.testing.assert_array_equal(image.uv, 3 * UV * [1, -1] + [0, 1])


def test_colours_of_corners_are_linear_and_sharp_at_borders() -> None:
    colors = np.ones((3, 3, 4))
    colors[..., :3] = np.random.default_rng(2).random((3, 3, 3))
    colors[2, :, :3] = [[1, 1, 0], [0, 0, 0], [0, 0, 1]]
    image = packed(
        Looks((Paint((1, 0.5, 1, 1)),), np.zeros(3, int), colors), None, MaterialImages().of
    )
    for triangle in range(3):
        for weights in points():
            truth = weights @ colors[triangle, :, :3] * [1, 0.5, 1]
            np.testing.assert_allclose(seen(image, triangle, weights), truth, atol=0.04)


def test_an_image_times_the_colours_of_corners() -> None:
    smooth = Image.fromarray(PIXELS).resize((64, 64), Image.Resampling.BICUBIC)
    colors = np.random.default_rng(2).random((2, 3, 4))
    looks = Looks((Paint(image=ImageSource(png(smooth), "p")),), np.zeros(2, int), colors)
    image = packed(looks, UV, MaterialImages().of)
    for triangle in range(2):
        for weights in points():
            place = weights @ (UV[triangle] * [64, -64] + [0, 64])
            truth = bilinear(np.asarray(smooth), place, WRAPS[REPEAT])
            truth = truth * (weights @ colors[triangle, :, :3])
            np.testing.assert_allclose(seen(image, triangle, weights), truth, atol=0.03)


def test_too_large_images_are_scaled_and_often_repeated_images_become_their_mean() -> None:
    large = ImageSource(
        png(np.repeat(np.uint8([[RED, BLUE]]), 1024, axis=1).repeat(2048, 0)), "large"
    )
    paints = (Paint(image=large), Paint((0.5, 1, 1, 1), image=large), Paint(image=IMAGE))
    uv = np.concatenate([3 * UV, 2 * UV, 1000 * UV])
    looks = Looks(paints, np.repeat([0, 1, 2], 2))
    image = packed(looks, uv, MaterialImages().of)
    assert image.scale < 1 and max(image.pixels.shape) <= 4096
    mean = srgb_to_linear(PIXELS / 255).mean(axis=(0, 1))
    np.testing.assert_allclose(seen(image, 4, points(1)[0]), mean, atol=0.01)
    for weights in points():
        u = (weights @ uv[0])[0] % 1
        if 0.01 < u % 0.5 < 0.49:
            truth = [1, 0, 0] if u < 0.5 else [0, 0, 1]
            np.testing.assert_allclose(seen(image, 0, weights), truth, atol=1e-6)


def test_a_mask_is_whole_or_open_and_its_texture_has_opacity(tmp_path: Path) -> None:
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[0, :, 3] = 100
    file = Gltf()
    material = file.add(
        "materials",
        alphaMode="MASK",
        alphaCutoff=0.4,
        pbrMetallicRoughness={"baseColorTexture": {"index": file.texture(pixels)}},
    )
    file.show(file.primitive(TEXCOORD_0=file.accessor(SQUARE_UV), material=material))
    model, notes = painted(load_mesh(file.write(tmp_path / "a.glb")))
    assert (model.tex_nchannel[0], notes) == (4, ())
    assert sorted(set(model.tex_data[3::4].tolist())) == [0, 255]


def half_clear(folder: Path) -> Path:
    """A square that is red, and clear in its upper half."""
    pixels = np.full((16, 16, 4), (*RED, 255), np.uint8)
    pixels[:8, :, 3] = 0
    file = Gltf()
    material = file.add(
        "materials",
        alphaMode="MASK",
        pbrMetallicRoughness={"baseColorTexture": {"index": file.texture(pixels)}},
    )
    file.show(file.primitive(TEXCOORD_0=file.accessor(SQUARE_UV), material=material))
    return file.write(folder / "a.glb")


def test_masks_have_holes_in_frames(opengl, tmp_path: Path) -> None:
    def rows(path: Path) -> np.ndarray:
        scene = drop_scene(path, bodies=0, up="y")
        simulation = Simulation(scene, fps=10, resolution=16, backend="cpu")
        source = FrameSource(simulation, width=96, height=72)
        frame = source.render(next(iter(snapshots(simulation, 1)))).astype(int)
        return np.nonzero(frame[..., 0] - frame[..., 2] > 60)[0]

    clear = rows(half_clear(tmp_path))
    (tmp_path / "a.glb").write_bytes((tmp_path / "a.glb").read_bytes().replace(b"MASK", b"SKIP"))
    whole = rows(tmp_path / "a.glb")
    assert len(clear) == pytest.approx(len(whole) / 2, rel=0.2)
    assert np.quantile(clear, 0.05) > whole.min() + 10


def test_emission_is_packed_beside_the_colours_it_belongs_to() -> None:
    """An image, a plain colour and colours without light, under the colours of corners."""
    glow = ImageSource(png(PIXELS[::-1]), "glow")
    paints = (
        Paint((0.5, 1, 1, 1), IMAGE, emission=(1, 1, 0.5), emission_image=glow),
        Paint((0, 0, 1, 1), emission=(0.2, 0.4, 0.6)),
        Paint((0, 0.5, 1, 1), unlit=True),
    )
    colors = np.ones((4, 3, 4))
    colors[3, :, 1] = 0.5
    for given, green in ((None, 0.5), (colors, 0.25)):
        looks = Looks(paints, np.array([0, 0, 1, 2]), given)
        image = packed(looks, np.concatenate([UV, UV]), MaterialImages().of)
        emitted = image._replace(pixels=image.glow)
        for weights in points(8):
            np.testing.assert_allclose(seen(emitted, 2, weights), [0.2, 0.4, 0.6], atol=0.01)
            np.testing.assert_allclose(seen(emitted, 3, weights), [0, green, 1], atol=0.01)
            np.testing.assert_allclose(seen(image, 3, weights), 0, atol=0.01)
            if given is None:
                u, v = weights @ UV[0]
                truth = bilinear(PIXELS[::-1], np.array([6 * u, 4 * (1 - v)]), WRAPS[REPEAT])
                np.testing.assert_allclose(
                    seen(emitted, 0, weights), truth * [1, 1, 0.5], atol=0.01
                )


def test_emission_is_seen_where_a_black_surface_reflects_nothing(opengl, tmp_path: Path) -> None:
    greens = []
    for emission in (0.0, 1.0):
        file = Gltf()
        gloss = {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0, "roughnessFactor": 1}
        material = file.add(
            "materials", pbrMetallicRoughness=gloss, emissiveFactor=[0, emission, 0]
        )
        file.show(file.primitive(material=material))
        path = file.write(tmp_path / "a.glb")
        scene = drop_scene(path, bodies=0, up="y", view="front", elevation=0, look="model")
        simulation = Simulation(scene, fps=10, resolution=16, backend="cpu")
        frame = FrameSource(simulation, width=64, height=48).render(
            next(iter(snapshots(simulation, 1)))
        )
        greens.append(frame[22:28, 29:35, 1].mean())
    assert greens[1] > 180 and greens[0] < 100


def glass_before_blue(folder: Path, opacity: float) -> Path:
    """A red square with an opacity, before a blue square that is as large."""
    file = Gltf()
    primitives = []
    for color, mode, depth in (((0, 0, 1, 1), "OPAQUE", 0), ((1, 0, 0, opacity), "BLEND", 0.2)):
        gloss = {"baseColorFactor": color, "metallicFactor": 0, "roughnessFactor": 1}
        material = file.add("materials", alphaMode=mode, pbrMetallicRoughness=gloss)
        points = SQUARE + np.float32([0, 0, depth])
        primitives.append(file.primitive(points, material=material))
    file.show(*primitives)
    return file.write(folder / "a.glb")


def test_half_transparent_parts_show_what_is_behind_them(opengl, tmp_path: Path) -> None:
    middles = []
    for opacity in (0.0, 0.5, 1.0):
        path = glass_before_blue(tmp_path, opacity)
        scene = drop_scene(path, bodies=0, up="y", view="front", elevation=0)
        simulation = Simulation(scene, fps=10, resolution=16, backend="cpu")
        frame = FrameSource(simulation, width=64, height=48).render(
            next(iter(snapshots(simulation, 1)))
        )
        middles.append(frame[20:28, 28:36].mean(axis=(0, 1)))
    behind, half, before = middles
    assert behind[2] > behind[0] + 50 and before[0] > before[2] + 50
    # the square in front takes light from the one behind
    np.testing.assert_allclose(half, (behind + before) / 2, atol=20)


def test_pages_have_images_of_small_squares_without_loss_and_holes(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (128, 128, 3), np.uint8)
    smooth = np.broadcast_to(np.arange(128, dtype=np.uint8)[:, None, None], (128, 128, 3))
    kinds = []
    for pixels in (noise, smooth, np.dstack([noise, noise[..., :1]])):
        Image.fromarray(np.ascontiguousarray(pixels)).save(tmp_path / "a.png")
        spec = mujoco.MjSpec()
        height, width, channels = pixels.shape
        two = mujoco.mjtTexture.mjTEXTURE_2D
        texture = spec.add_texture(
            name="t", type=two, height=height, width=width, nchannel=channels
        )
        texture.data = np.ascontiguousarray(pixels).tobytes()
        head, _, data = data_uri(spec.compile(), 0).partition(",")
        kinds.append(head)
        if "webp" in head:
            with Image.open(io.BytesIO(base64.b64decode(data))) as image:
                opaque = pixels[..., -1] > 0 if channels == 4 else np.ones((128, 128), bool)
                np.testing.assert_array_equal(np.asarray(image)[opaque], pixels[opaque])
    assert kinds == [f"data:image/{kind};base64" for kind in ("webp", "jpeg", "webp")]


def painted(mesh: Mesh, texture=None) -> tuple[mujoco.MjModel, tuple[str, ...]]:
    spec = mujoco.MjSpec()
    # MuJoCo takes no mesh that is flat
    V = mesh.V + mesh.V[:, :1] * mesh.V[:, 1:2] * [0, 0, 1]
    asset = spec.add_mesh(name="target", uservert=V.ravel(), userface=mesh.F.ravel())
    asset.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.worldbody.add_geom(name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="target")
    notes = paint_target(spec, mesh, "mesh.glb", texture)
    return spec.compile(), notes


def test_half_transparent_materials_have_opacity_and_gloss_is_the_mean(tmp_path: Path) -> None:
    file = Gltf()
    gloss = file.texture([[[0, 128, 255]]])
    first = file.add(
        "materials",
        alphaMode="BLEND",
        pbrMetallicRoughness={
            "baseColorFactor": [1, 0, 0, 0.2],
            "metallicRoughnessTexture": {"index": gloss},
        },
    )
    second = file.add("materials", pbrMetallicRoughness={"metallicFactor": 0})
    file.show(file.primitive(material=first), file.primitive(3 * SQUARE + 1, material=second))
    model, notes = painted(load_mesh(file.write(tmp_path / "a.glb")))
    assert notes == ()
    assert model.tex_nchannel[0] == 4
    assert sorted(set(model.tex_data[3::4].tolist())) == [51, 255]
    assert model.mat_metallic[0] == pytest.approx(0.1)
    assert model.mat_roughness[0] == pytest.approx((128 / 255 + 9) / 10)


def test_lost_images_are_named_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "damaged.png").write_bytes(b"no image")
    file = Gltf()
    sources = [
        {"uri": "damaged.png"},
        {"uri": "gone.png"},
        {"bufferView": file.view(b"\xabKTX 20\xbb\r\n\x1a\n"), "name": "compressed"},
    ]
    primitives = []
    for number, source in enumerate(sources):
        texture = file.add("textures", source=file.add("images", **source))
        look = {"baseColorTexture": {"index": texture}, "baseColorFactor": [0, 1, 0, 1]}
        material = file.add("materials", pbrMetallicRoughness=look)
        primitives.append(file.primitive(SQUARE + 2 * number, material=material))
    file.show(*primitives)
    model, notes = painted(load_mesh(file.write(tmp_path / "a.glb")))
    assert len(notes) == 1
    assert notes[0].startswith(
        "3 of 3 images are not shown: image 'damaged.png' cannot be read: it is damaged"
    )
    assert "'gone.png' is missing, 'compressed' is KTX2" in notes[0]
    assert (model.tex_data.reshape(-1, 3)[0] == [0, 255, 0]).all()


@pytest.mark.parametrize(
    ("kind", "mode"),
    [
        *(("png", mode) for mode in ("I;16", "LA", "P", "1")),
        *(("tif", mode) for mode in ("I;16", "F", "LA", "P", "1", "CMYK")),
    ],
)
def test_images_of_every_depth_become_bytes(tmp_path: Path, mode: str, kind: str) -> None:
    grey = np.array([[0, 64], [128, 255]], np.uint8)
    if mode == "I;16":
        image = Image.fromarray(grey.astype(np.uint16) * 257)
    elif mode == "F":
        image = Image.fromarray((grey / 255).astype(np.float32))
    else:
        image = Image.fromarray(grey).convert(mode)
    image.save(tmp_path / f"a.{kind}")
    expected = grey if mode != "1" else np.where(np.asarray(image), 255, 0)
    found = load_image(tmp_path / f"a.{kind}")
    np.testing.assert_allclose(found, np.repeat(expected[..., None], 3, axis=2), atol=1)


def test_floats_beyond_one_are_scaled_to_their_range(tmp_path: Path) -> None:
    Image.fromarray(np.array([[-1.0, 1.0, 3.0]], np.float32)).save(tmp_path / "a.tif")
    assert load_image(tmp_path / "a.tif")[0, :, 0].tolist() == [0, 128, 255]


def test_drop_keeps_every_material_in_the_model_that_mujoco_draws(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 0 1\n")
    text = (
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl a\nf 1 3 2\nf 1 2 4\nusemtl b\n"
    )
    (tmp_path / "a.obj").write_text(text + "f 2 3 4\nf 1 4 3\n")
    model = drop_scene(tmp_path / "a.obj", bodies=0).model
    height, width = int(model.tex_height[0]), int(model.tex_width[0])
    pixels = model.tex_data.reshape(height, width, 3)
    uv = model.mesh_texcoord[model.mesh_facetexcoord].mean(axis=1)
    found = [tuple(pixels[int(v * height), int(u * width)].tolist()) for u, v in uv]
    assert sorted(found) == [BLUE, BLUE, RED, RED]
    srgb = linear_to_srgb(srgb_to_linear(np.array(RED) / 255))
    np.testing.assert_allclose(255 * srgb, RED)


MJCF = """<mujoco><compiler meshdir="meshes"/><asset><mesh name="a" file="a.obj" scale="2 2 2"/>
</asset><worldbody><geom name="g" type="mesh" mesh="a" {}/></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("look", "more", "textures"),
    [("model", "", 1), ("rubber", "", 0), ("model", 'rgba="1 0 0 1"', 0)],
)
def test_a_scene_file_shows_the_materials_of_a_mesh_file(
    tmp_path: Path, look: str, more: str, textures: int
) -> None:
    """They reach flex colliders too, and nothing that the MJCF says is replaced."""
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/a.mtl").write_text("newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 0 1\n")
    text = (
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl a\nf 1 3 2\nf 1 2 4\nusemtl b\n"
    )
    (tmp_path / "meshes/a.obj").write_text(text + "f 2 3 4\nf 1 4 3\n")
    (tmp_path / "scene.xml").write_text(MJCF.format(more))
    ripple = f'model = "scene.xml"\n[[ripple]]\ngeom = "g"\nlook = "{look}"\n'
    (tmp_path / "scene.toml").write_text(ripple)
    for route in (None, "flex"):
        edit = None if route is None else lambda spec: make_collidable(spec, "g", "flex")
        model = load_scene(tmp_path / "scene.toml", edit=edit).model
        assert model.ntex == textures
        assert np.ptp(model.mesh_vert, axis=0).max() > 1.9
        if textures:
            height, width = int(model.tex_height[0]), int(model.tex_width[0])
            pixels = model.tex_data.reshape(height, width, 3)
            uv = model.mesh_texcoord[model.mesh_facetexcoord].mean(axis=1)
            found = [tuple(pixels[int(v * height), int(u * width)].tolist()) for u, v in uv]
            assert sorted(found) == [BLUE, BLUE, RED, RED]
            assert model.mat_texid[model.geom("g").matid[0]].max() == 0
