"""The command `ripple-sim atlas`: its report, its picture, and mending on request."""

import json
import re
import signal
import sys

import numpy as np
import pytest
import trimesh
from PIL import Image

from ripple_sim.cli import main as cli
from ripple_sim.figures.atlas_painter import AtlasPainter, texel_stretch
from ripple_sim.figures.atlas_plot import plot_atlas
from ripple_sim.figures.view import View
from ripple_sim.scene.up_axis import usual_up
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, AtlasError, Mesh, build_atlas, sphere_atlas


@pytest.fixture(autouse=True)
def _left_as_found(tmp_path_factory, monkeypatch):
    """Keep the program's signal handler and its cache to these tests."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


@pytest.fixture(scope="module")
def animal() -> Atlas:
    return build_atlas(Mesh.from_arrays(*limbed()), 32, cache=False)


@pytest.fixture
def ball_file(tmp_path):
    """A ball of radius 2 with one triangle turned, one doubled and a vertex too many."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=2)
    F = np.vstack([ball.faces[:1, ::-1], ball.faces[1:], ball.faces[:1]])
    trimesh.Trimesh(np.vstack([ball.vertices, [[9, 9, 9]]]), F, process=False).export(tmp_path / "ball.off")
    return tmp_path / "ball.off"


def refusal(capsys, *argv: str) -> str:
    assert cli.main(argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    return err


def test_json_tells_size_area_quality_seconds_and_what_was_mended(capsys, ball_file):
    assert cli.main(["atlas", str(ball_file), "--resolution", "8", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["mesh"] == str(ball_file)
    assert (report["vertices"], report["triangles"], report["method"]) == (162, 320, "progressive")
    np.testing.assert_allclose(report["size"], 4, rtol=0.02)
    assert report["area"] == pytest.approx(16 * np.pi, rel=0.03)
    assert report["volume"] == pytest.approx(32 / 3 * np.pi, rel=0.05)
    assert report["fixes"] == [
        "1 unreferenced vertices dropped",
        "1 repeated triangles dropped",
        "1 triangles reversed (inconsistent winding)",
    ]
    assert {"flipped", "solid_angle", "q001", "q50", "q999", "starved", "coverage"} <= report["quality"].keys()
    assert {"load", "sphere_map", "rays"} == report["seconds"].keys()
    assert cli.main(["atlas", str(ball_file), "--resolution", "8", "--json"]) == 0
    assert {"load", "cache"} == json.loads(capsys.readouterr().out)["seconds"].keys()


def test_the_plain_report_says_the_same(capsys, ball_file):
    assert cli.main(["atlas", str(ball_file), "--resolution", "8"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^size +4 x .* m$", out, re.MULTILINE)
    assert re.search(r"^area +4\d\.\d+ m\^2$", out, re.MULTILINE)
    assert len(re.findall(r"^repaired +1 ", out, re.MULTILINE)) == 3
    assert re.search(r"^sphere map time +\d+\.\d{3} s$", out, re.MULTILINE)


def test_a_picture_is_written_and_is_not_blank(tmp_path, capsys, ball_file):
    picture = tmp_path / "atlas.png"
    assert cli.main(["atlas", str(ball_file), "--resolution", "8", "--json", "--plot", str(picture)]) == 0
    assert "plot" in json.loads(capsys.readouterr().out)["seconds"]
    pixels = np.asarray(Image.open(picture).convert("RGB"))
    assert pixels.shape == (1080, 1920, 3)
    assert (pixels[0] == 255).all()  # a white margin
    for part in (pixels[200:900, 100:600], pixels[200:500, 1250:1800], pixels[600:1000, 820:1150]):
        assert part.std() > 20  # mesh, cross and sphere


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("atlas.bmp", r"'atlas\.bmp'.*valid are \.png"),
        ("atlas", "valid are"),
        ("slot_scratch/atlas.png", "folder that exists"),
    ],
)
def test_a_picture_that_cannot_be_written_is_refused_before_the_mesh_is_read(capsys, monkeypatch, tmp_path, path, said):
    monkeypatch.chdir(tmp_path)
    assert re.search(said, refusal(capsys, "atlas", "missing.obj", "--plot", path))


def test_a_full_disk_is_one_line(monkeypatch, tmp_path, animal):
    def full(self, path, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(AtlasPainter, "mesh", lambda self, view, size: np.zeros((4, 4, 4)))
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", full)
    with pytest.raises(AtlasError, match="No space left"):
        plot_atlas(animal, tmp_path / "atlas.png", title="animal")


def test_stretch_is_one_on_a_sphere_and_even_on_average(animal):
    np.testing.assert_allclose(texel_stretch(sphere_atlas(3.0, 16)), 1)
    stretch = texel_stretch(animal)
    assert stretch.min() < 0.95
    assert 1.05 < stretch.max() < 4
    # area-weighted quantiles agree with those of the mesh's triangles
    order = np.argsort(stretch.ravel())
    share = np.cumsum(animal.areas.ravel()[order]) / animal.areas.sum()
    assert stretch.ravel()[order][np.searchsorted(share, 0.5)] == pytest.approx(animal.quality()["q50"], abs=0.05)


def test_pictures_show_the_texel_that_lies_there():
    n = 8
    atlas = sphere_atlas(1.0, n)
    numbers = np.arange(6 * n * n).reshape(6, n, n)
    colors = np.stack([numbers % 16, numbers // 16 % 16, numbers // 256], axis=-1) / 16
    cross = AtlasPainter(atlas, colors).cross(64)
    assert cross.shape == (192, 256, 4)
    # face -y stands in the middle of the cross, second from the left, row 0 at the bottom
    for row, column in ((0, 0), (3, 5), (7, 7)):
        pixel = cross[127 - (row * 8 + 4), 64 + column * 8 + 4]
        np.testing.assert_allclose(pixel[:3], colors[3, row, column], atol=1e-9)
    assert cross[10, 10, 3] == 0


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_up_axis_points_up(up):
    axes = View(azimuth=20, elevation=30, up=up).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    right, upwards, eye = axes[:, "xyz".index(up)]
    assert (right, upwards > 0.8, eye > 0.4) == (pytest.approx(0), True, True)
    assert usual_up("part.STL") == "z"
    assert usual_up("animal.obj") == "y"


def test_neighbouring_faces_of_the_cross_belong_together():
    atlas = sphere_atlas(1.0, 16)
    smooth = (atlas.positions + 1) / 2
    cross = AtlasPainter(atlas, smooth).cross(32)[..., :3]
    middle = cross[48, 4::8]  # along the belt, where colours go round the sphere and are slot_scratch far apart
    assert np.abs(np.diff(middle, axis=0)).max() < 0.4
    # above and below the face -y
    np.testing.assert_allclose(cross[30, 48], cross[33, 48], atol=0.2)
    np.testing.assert_allclose(cross[62, 48], cross[66, 48], atol=0.2)


def test_the_axis_is_checked(capsys):
    assert "'x'" in refusal(capsys, "atlas", "mesh.obj", "--up", "x")


@pytest.mark.parametrize("command", [["atlas"], ["drop", "-o", "clip.mp4"]])
def test_repair_mends_or_says_what_to_install(capsys, monkeypatch, tmp_path, command):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "pymeshfix", None)
    ball = trimesh.creation.icosphere(subdivisions=2)
    trimesh.Trimesh(ball.vertices, ball.faces[3:], process=False).export(tmp_path / "open.off")
    assert "boundary edges" in refusal(capsys, *command, "open.off")
    assert "pip install 'ripple-sim[repair]'" in refusal(capsys, *command, "open.off", "--repair")


def test_repair_says_what_it_did(capsys, tmp_path):
    pytest.importorskip("pymeshfix")
    ball = trimesh.creation.icosphere(subdivisions=2)
    trimesh.Trimesh(ball.vertices, ball.faces[3:], process=False).export(tmp_path / "open.off")
    assert cli.main(["atlas", str(tmp_path / "open.off"), "--resolution", "8", "--repair", "--json"]) == 0
    [fix, *_] = json.loads(capsys.readouterr().out)["fixes"]
    assert re.search(r"repaired by pymeshfix: 317 triangles became 3\d\d.*open: \d boundary edges", fix)


def test_a_wrong_method_is_refused(animal):
    with pytest.raises(AtlasError, match="'progressive', 'conformal'"):
        build_atlas(animal.mesh, 8, method="mercator")
