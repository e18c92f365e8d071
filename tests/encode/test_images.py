"""Image files: linear light, complete EXR frames, early refusals, and files of passes."""

import dataclasses
import json
import sys
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco_models import posed
from sphere_height_maps import cube_charts
from unfinished_videos import contents, egg_scene, interrupting_at, written_until_full

from ripple_sim import Scene, VideoOptions, render_video
from ripple_sim.cli import main as cli
from ripple_sim.encode import PassFiles, check_passes, open_writer
from ripple_sim.errors import VideoError
from ripple_sim.overlay import color_table
from ripple_sim.render import Camera, Renderer, Surface, tone_mapped
from ripple_sim.render.visuals import shapes as meshes
from ripple_sim.solver import RippleError
from ripple_sim.solver.gl import shared_context

WIDTH = 64
HEIGHT = 48
FRONT = Camera((0.0, 0.0, 0.0), 5.0, 70.0, -20.0, 40.0)
BODIES = """<body pos="1 0 0"><geom type="box" size=".3 .3 .5" rgba=".1 .2 .7 1"/></body>
<body pos="-1 0 .2"><geom size=".4" rgba=".8 .3 .1 1"/></body>"""
FLOOR = '<geom type="plane" size="0 0 1" pos="0 0 -.5"/>'
OPTIONS = {"size": (WIDTH, HEIGHT), "fps": 30, "frame_format": "exr"}
pytestmark = pytest.mark.usefixtures("signals_as_found")


@pytest.fixture
def exr() -> None:
    """Skip where OpenEXR is not installed: it is an extra."""
    pytest.importorskip("OpenEXR")


@pytest.fixture
def scene(tmp_path: Path, opengl: None) -> Scene:
    return egg_scene(tmp_path, FLOOR, duration=0.4, density=20.0)


def read(path: Path) -> np.ndarray:
    import OpenEXR

    [channels] = OpenEXR.File(str(path)).channels().values()
    return channels.pixels


def render(bodies: str = BODIES, asset: str = "", **options) -> np.ndarray:
    model, data = posed(f"<mujoco>{asset}<worldbody>{bodies}</worldbody></mujoco>")
    with Renderer(shared_context(), model, {}, size=(120, 90), **options) as renderer:
        return renderer.render(data, {}, FRONT)


@pytest.mark.usefixtures("exr")
@pytest.mark.parametrize("channels", [3, 4])
def test_exr_values_are_lossless_and_the_header_names_their_colours(
    tmp_path: Path, channels: int
) -> None:
    import OpenEXR

    rng = np.random.default_rng(3)
    light = np.exp(rng.uniform(-9, 11, (3, HEIGHT, WIDTH, channels))).astype(np.float16)
    for name in ("first", "second"):
        options = {"transparent": channels == 4, "frame_format": "exr"}
        with open_writer(tmp_path / name, width=WIDTH, height=HEIGHT, fps=24, **options) as writer:
            for frame in light:
                writer.write(frame)
    files = sorted((tmp_path / "first").iterdir())
    assert [file.name for file in files] == [f"frame_{number:05d}.exr" for number in range(3)]
    np.testing.assert_array_equal([read(file) for file in files], light)
    assert contents(tmp_path / "first") == contents(tmp_path / "second")
    header = OpenEXR.File(str(files[0])).header()
    assert header["framesPerSecond"] == Fraction(24)
    bt709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    assert header["chromaticities"] == pytest.approx(bt709)
    assert not {"capDate", "owner", "comments"} & set(header)


def test_eight_bit_frames_are_refused_as_linear_light(exr: None, tmp_path: Path) -> None:
    refused = pytest.raises(VideoError, match=r"frame must be float16 \[48, 64, 3\], got uint8")
    size = {"width": WIDTH, "height": HEIGHT, "fps": 24}
    with refused, open_writer(tmp_path / "frames", **size, frame_format="exr") as writer:
        writer.write(np.zeros((HEIGHT, WIDTH, 3), np.uint8))


def test_a_disk_that_fills_up_at_the_end_of_a_file_is_an_error(exr: None, tmp_path: Path) -> None:
    """Half a frame of noise cannot be packed into less than it is: the file's end is cut off."""
    said = written_until_full(
        tmp_path / "frames", 60 * 60 * 3 * 2 - 1000, 60, 60, 1, frame_format="exr"
    )
    assert said == f"cannot write the video {tmp_path / 'frames'}: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_without_openexr_the_extra_is_named(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    options = ["-o", str(tmp_path / "frames"), "--frame-format", "exr"]
    assert cli.main(["render", "duck", *options]) == 2
    assert "pip install 'ripple-sim[exr]'" in capsys.readouterr().err
    # a wrong argument is reported before a missing package
    assert cli.main(["render", "missing", *options]) == 2
    assert "missing" in capsys.readouterr().err


def test_linear_light_with_overlays_or_comparisons_is_refused(
    exr: None, scene: Scene, tmp_path: Path, capsys
):
    frames = ["-o", str(tmp_path / "frames"), "--frame-format", "exr"]
    for option in (["--overlay", "time"], ["--compare", "paper"]):
        assert cli.main(["render", "duck", *frames, *option]) == 2
        assert "linear light, without overlays" in capsys.readouterr().err
    overlaid = dataclasses.replace(scene, overlay=("time",))
    with pytest.raises(VideoError, match="linear light, without overlays"):
        render_video(overlaid, tmp_path / "frames", VideoOptions(**OPTIONS))
    assert not (tmp_path / "frames").exists()


def test_the_command_writes_a_folder_over_older_frames(
    exr: None, scene: Scene, tmp_path: Path
) -> None:
    render_video(scene, tmp_path / "frames", VideoOptions(size=(WIDTH, HEIGHT), fps=30))
    command = [
        "render",
        str(tmp_path / "scene.toml"),
        "-o",
        str(tmp_path / "frames"),
        "--frame-format",
        "exr",
    ]
    assert (
        cli.main([*command, "--size", f"{WIDTH}x{HEIGHT}", "--fps", "30", "--duration", "0.1"]) == 0
    )
    assert sorted(contents(tmp_path / "frames")) == [
        f"frame_{number:05d}.exr" for number in range(3)
    ]


def test_an_interrupted_render_continues_to_the_same_frames(
    exr: None, scene: Scene, tmp_path: Path
) -> None:
    options = {**OPTIONS, "transparent": True}
    render_video(scene, tmp_path / "whole", VideoOptions(**options))
    with pytest.raises(KeyboardInterrupt):
        render_video(
            scene, tmp_path / "broken", VideoOptions(**options), progress=interrupting_at(8)
        )
    with pytest.raises(VideoError, match="the frame format was exr and now is png"):
        render_video(
            scene,
            tmp_path / "broken",
            VideoOptions(resume=True, **{**options, "frame_format": "png"}),
        )
    assert (
        render_video(scene, tmp_path / "broken", VideoOptions(resume=True, **options)).frames == 12
    )
    assert contents(tmp_path / "broken") == contents(tmp_path / "whole")


def test_the_tone_curve_makes_the_picture_of_linear_light(opengl: None) -> None:
    light = render(BODIES + FLOOR, samples=1, linear=True)
    picture = render(BODIES + FLOOR, samples=1)
    assert (light.dtype, light.shape) == (np.float16, picture.shape)
    # half a step of dithering, half a step of rounding, what half floats leave out, and that the
    # smooth background is interpolated before the curve or after it
    assert np.abs(255 * tone_mapped(light.astype(float)) - picture).max() < 1.6


def test_exr_frames_keep_highlights_beyond_the_screens_range(opengl: None) -> None:
    metal = '<asset><material name="m" metallic="1" roughness=".2"/></asset>'
    light, picture = (
        render('<geom size="1" material="m"/>', metal, samples=1, linear=way)
        for way in (True, False)
    )
    white = picture.min(axis=-1) >= 245
    assert white.sum() > 20
    assert light[white].min() > 1 and light[white].max() > 10
    assert np.isfinite(light).all()


def test_reflections_and_clear_bodies_are_mixed_in_linear_light(opengl: None) -> None:
    def floor(reflectance: float) -> np.ndarray:
        asset = f'<asset><material name="f" rgba=".5 .5 .5 1" reflectance="{reflectance}"/></asset>'
        return render(BODIES + FLOOR.replace("/>", ' material="f"/>'), asset, linear=True).astype(
            float
        )

    def ball(opacity: float) -> np.ndarray:
        return render(f'<geom size="1" rgba=".8 .3 .1 {opacity}"/>', samples=1, linear=True).astype(
            float
        )

    for less, half, more in (
        [floor(r) for r in (0.25, 0.5, 0.75)],
        [ball(a) for a in (0.0, 0.5, 1.0)],
    ):
        assert np.abs(more - less).max() > 0.2
        np.testing.assert_allclose(half, (less + more) / 2, atol=1e-3)


def test_light_is_multiplied_by_opacity_so_that_it_lies_over_any_background(opengl: None) -> None:
    """The frame is the cut-out over the empty scene: a + (1 - alpha) b."""
    whole, empty = (
        render(bodies, linear=True).astype(float) for bodies in (BODIES, "<geom size='1e-3'/>")
    )
    cut_out = render(linear=True, alpha=True).astype(float)
    light = cut_out[..., :3]
    opacity = cut_out[..., 3:]
    assert (opacity.min(), opacity.max()) == (0, 1)
    edges = (opacity[..., 0] > 0) & (opacity[..., 0] < 1)
    assert edges.sum() > 50
    np.testing.assert_allclose(light + (1 - opacity) * empty, whole, rtol=3e-3, atol=1e-3)
    assert (light[opacity[..., 0] == 0] == 0).all()


def test_fields_and_grids_are_refused_in_linear_light(opengl: None) -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom size="1"/></worldbody></mujoco>'
    )
    ball = meshes.ball(8)
    for paint in ({"heatmap_colors": color_table()}, {"grid": 4}):
        surface = Surface(ball.shell, ball.faces, cube_charts(ball.shell, 8), "clay", **paint)
        with pytest.raises(RippleError, match="linear=False"):
            Renderer(shared_context(), model, {0: surface}, size=(32, 32), linear=True)


DEPTH = np.linspace(1, 2, 12, dtype=np.float32).reshape(3, 4)
PASSES = {
    "depth": DEPTH,
    "flow": np.stack([DEPTH, -DEPTH], axis=-1),
    "segmentation": np.ones((3, 4), np.uint32),
}


def pass_files(video: Path, form: str = "npz", geoms: Mapping[int, str] | None = None) -> PassFiles:
    """Where the passes of a video go, begun."""
    files = PassFiles(video, form, geoms or {})
    files.begin()
    return files


def test_npz_files_hold_the_passes_bit_for_bit_and_are_the_same_each_time(tmp_path: Path) -> None:
    contents = []
    for _ in range(2):
        files = pass_files(tmp_path / "clip.mp4", "npz", {0: "background", 1: "floor"})
        files.write(7, PASSES)
        path = tmp_path / "clip.passes" / "passes_00007.npz"
        contents.append(path.read_bytes())
    with np.load(path) as found:
        assert all(np.array_equal(found[name], values) for name, values in PASSES.items())
    assert contents[0] == contents[1]
    geoms = json.loads((tmp_path / "clip.passes" / "segmentation.json").read_text())["geoms"]
    assert geoms == {"0": "background", "1": "floor"}


def test_exr_files_hold_the_passes_as_channels(tmp_path: Path) -> None:
    openexr = pytest.importorskip("OpenEXR")
    pass_files(tmp_path / "frames", "exr").write(0, PASSES)
    path = str(tmp_path / "frames.passes" / "passes_00000.exr")
    channels = openexr.File(path, separate_channels=True).channels()
    assert set(channels) == {"depth", "flow.X", "flow.Y", "segmentation"}
    assert np.array_equal(channels["flow.Y"].pixels, -DEPTH)
    assert channels["segmentation"].pixels.dtype == np.uint32
    check_passes(tmp_path / "frames", ("depth",), "exr", overwrite=False)


def test_half_written_files_of_a_killed_job_are_replaced(tmp_path: Path) -> None:
    files = pass_files(tmp_path / "clip.mp4")
    files.write(0, PASSES)
    for name in ("passes_00000.npz", "segmentation.json"):
        (files.folder / f".{name}").write_bytes((files.folder / name).read_bytes()[:20])
    check_passes(tmp_path / "clip.mp4", ("depth",), "npz", overwrite=False)
    pass_files(tmp_path / "clip.mp4")
    assert [each.name for each in files.folder.iterdir()] == ["segmentation.json"]


def test_unknown_passes_and_foreign_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match="depth, normal, segmentation, flow, position, height"):
        check_passes(tmp_path / "clip.mp4", ("colour",), "npz", overwrite=False)
    with pytest.raises(VideoError, match="'npz' or 'exr'"):
        check_passes(tmp_path / "clip.mp4", ("depth",), "png", overwrite=False)
    pass_files(tmp_path / "clip.mp4").write(0, PASSES)
    check_passes(tmp_path / "clip.mp4", ("depth",), "npz", overwrite=False)
    # which came between the check and the first frame
    with pytest.raises(VideoError, match=r"those of clip\.mp4"):
        pass_files(tmp_path / "clip.webm")
    foreign = tmp_path / "clip.passes" / "passes_00001.npz"
    foreign.write_bytes(b"mine")
    with pytest.raises(VideoError, match="other files"):
        check_passes(tmp_path / "clip.mp4", ("depth",), "npz", overwrite=False)
    foreign.with_name("segmentation.json").write_text("[" * 100_000)
    check_passes(tmp_path / "clip.mp4", ("depth",), "npz", overwrite=True)
    foreign.rename(foreign.with_name("thesis.txt"))
    with pytest.raises(VideoError, match=r"thesis\.txt"):
        check_passes(tmp_path / "clip.mp4", ("depth",), "npz", overwrite=True)
