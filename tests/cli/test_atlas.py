"""`ripple-sim atlas`: its report, its figure, its refusals."""

import json
import re
import sys

import numpy as np
import pytest
import trimesh
from genus_zero import thin_limb
from PIL import Image

from ripple_sim.cli import main as cli
from ripple_sim.figures import atlas_painter


@pytest.fixture
def coarse_pictures(monkeypatch):
    """Draw pictures without oversampling, which takes most of their time."""
    monkeypatch.setattr(atlas_painter, "OVERSAMPLING", 1)


BALL = trimesh.creation.icosphere(subdivisions=2)


@pytest.fixture
def ball_file(tmp_path):
    """A ball of radius 2 with one triangle turned, one doubled and a vertex too many."""
    F = np.vstack([BALL.faces[:1, ::-1], BALL.faces[1:], BALL.faces[:1]])
    trimesh.Trimesh(np.vstack([2 * BALL.vertices, [[9, 9, 9]]]), F, process=False).export(
        tmp_path / "ball.off"
    )
    return tmp_path / "ball.off"


@pytest.fixture
def open_file(tmp_path):
    """A ball without the triangles round a vertex."""
    open_ball = trimesh.Trimesh(
        BALL.vertices, BALL.faces[(BALL.faces != 0).all(axis=1)], process=False
    )
    open_ball.export(tmp_path / "open.off")
    return tmp_path / "open.off"


@pytest.fixture
def report_of(capsys):
    """Run `ripple-sim atlas` on a mesh; return its report."""

    def run(path, *words, resolution=8):
        command = ["atlas", path, "--resolution", resolution, "--json", *words]
        assert cli.main([str(word) for word in command]) == 0
        return json.loads(capsys.readouterr().out)

    return run


def test_json_has_size_area_quality_seconds_and_repairs(report_of, ball_file):
    report = report_of(ball_file)
    assert report["mesh"] == str(ball_file)
    assert (report["vertices"], report["triangles"], report["method"]) == (162, 320, "progressive")
    np.testing.assert_allclose(report["size"], 4, rtol=0.02)
    assert report["area"] == pytest.approx(16 * np.pi, rel=0.03)
    assert report["volume"] == pytest.approx(32 / 3 * np.pi, rel=0.05)
    notes = (
        "1 unreferenced vertex dropped, 1 repeated triangle dropped, 1 triangle reversed "
        "(inconsistent winding)"
    )
    assert report["notes"] == notes.split(", ")
    assert {"flipped", "solid_angle", "q001", "q50", "q999", "starved", "coverage"} <= report[
        "quality"
    ].keys()
    assert {"load", "sphere_map", "rays"} == report["seconds"].keys()
    assert {"load", "cache"} == report_of(ball_file)["seconds"].keys()


def test_a_body_with_a_limb_gets_patches_with_a_reason_in_the_report(report_of, tmp_path):
    V, F = thin_limb(3, 0.1)
    trimesh.Trimesh(V, F, process=False).export(tmp_path / "limb.off")
    report = report_of(tmp_path / "limb.off")
    assert (report["layout"], report["method"]) == ("patches", None)
    assert re.search(r"the cube would be up to \d+ times as long as wide", *report["notes"])


def test_the_plain_report_has_the_same_facts(capsys, ball_file):
    assert cli.main(["atlas", str(ball_file), "--resolution", "8"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^size +4 x .* m$", out, re.MULTILINE)
    assert re.search(r"^area +4\d\.\d+ m\^2$", out, re.MULTILINE)
    assert len(re.findall(r"^note +1 ", out, re.MULTILINE)) == 3
    assert re.search(r"^sphere map time +\d+\.\d{3} s$", out, re.MULTILINE)


def test_a_picture_is_written_and_is_not_blank(coarse_pictures, tmp_path, report_of, ball_file):
    picture = tmp_path / "atlas.png"
    assert "plot" in report_of(ball_file, "--plot", picture)["seconds"]
    pixels = np.asarray(Image.open(picture).convert("RGB"))
    assert pixels.shape == (1080, 1920, 3)
    assert (pixels[0] == 255).all()  # a white margin
    for part in (pixels[200:900, 100:600], pixels[200:500, 1250:1800], pixels[600:1000, 820:1150]):
        assert part.std() > 20  # mesh, cross and sphere


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("atlas.bmp", r"'atlas\.bmp'.*must end in \.png"),
        ("atlas", "must end in"),
        ("no/atlas.png", "folder that exists"),
    ],
)
def test_a_picture_that_cannot_be_written_is_refused_before_the_mesh_is_read(
    refusal, monkeypatch, tmp_path, path, said
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mesh.obj").write_text("no mesh")
    assert re.search(said, refusal("atlas", "mesh.obj", "--plot", path))


def test_repair_closes_holes_or_names_the_package_to_install(refusal, monkeypatch, open_file):
    monkeypatch.setitem(sys.modules, "pymeshfix", None)
    assert "boundary edges" in refusal("atlas", str(open_file), "--layout", "cube")
    for command in (["atlas"], ["drop", "-o", "clip.mp4"]):
        assert "pip install 'ripple-sim[repair]'" in refusal(*command, str(open_file), "--repair")


def test_repair_lists_its_changes(report_of, open_file):
    pytest.importorskip("pymeshfix")
    unreferenced, hole = report_of(open_file, "--repair")["notes"]
    assert unreferenced.startswith("1 unreferenced")
    assert hole.startswith("hole closed")


def test_wrapped_balls_get_one_atlas_and_a_note(capsys, refusal, tmp_path):
    trimesh.util.concatenate([BALL, BALL.copy().apply_translation([1, 0, 0])]).export(
        tmp_path / "balls.off"
    )
    command = ["atlas", str(tmp_path / "balls.off"), "--resolution", "8"]
    assert "2 separate parts" in refusal(*command, "--layout", "cube")
    assert cli.main([*command, "--wrap"]) == 0
    line = (
        r"^note +wrapped, 0\.045 m off: 2 parts in 1 closed surface with 0 handles, [\d,]+ "
        r"triangles$"
    )
    assert re.search(line, capsys.readouterr().out, re.MULTILINE)


def test_an_open_mesh_gets_patches(report_of, open_file):
    report = report_of(open_file, resolution=32)
    assert (report["layout"], report["method"], report["quality"]["flipped"]) == (
        "patches",
        None,
        0,
    )
    charts, n, _ = report["charts"]
    assert charts * n * n == pytest.approx(6 * 32**2, rel=0.2)


def test_the_thickness_over_an_inner_body_is_reported_and_drawn(
    coarse_pictures, tmp_path, report_of, refusal, ball_file
):
    core = tmp_path / "core.off"
    plot = tmp_path / "thickness.png"
    trimesh.creation.icosphere(subdivisions=3, radius=1.5).export(core)
    thickness = report_of(ball_file, "--inside", core, "--plot", plot)["thickness"]
    assert thickness["least"] <= thickness["median"] <= thickness["greatest"]
    # over a ball of radius 2 with flat sides
    assert thickness["median"] == pytest.approx(0.5, rel=0.08)
    pixels = np.asarray(Image.open(plot).convert("RGB"))
    assert pixels[200:900, 200:800].std() > 20
    of_a_mesh = refusal("atlas", str(ball_file), "--inside", str(core), "--threshold", "3")
    assert of_a_mesh.count("takes no threshold") == 1
    assert "--inside" in refusal("atlas", str(ball_file), "--threshold", "3")
