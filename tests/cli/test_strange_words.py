"""Strange words on the command line: one line that is no longer than a line should be, and status 2, at once."""

from pathlib import Path

import pytest

from ripple_sim import bench
from ripple_sim.cli import main as cli

LONG = "a" * 5000
MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def refusal(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    assert cli.main(argv) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert len(err) < 900
    return err


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        (["render", LONG, "-o", "x.mp4"], "there is no scene 'aaa"),
        (["render", "sphere", "-o", f"{LONG}.mp4"], "File name too long"),
        (["render", "sphere", "-o", "x.mp4", "--size", "9" * 5000], "is not a frame size"),
        (["render", "sphere", "-o", "x\0.mp4"], "NUL"),
        (["render", "a\0", "-o", "x.mp4"], "NUL"),
        (["atlas", LONG], "File name too long"),
        (["atlas", "mesh.obj", "-o", f"{LONG}.npz"], "File name too long"),
        (["atlas", "mesh.obj", "--plot", f"{LONG}.png"], "File name too long"),
        (["drop", f"{LONG}.obj", "-o", "x.mp4"], "File name too long"),
        (["bench", LONG], "File name too long"),
    ],
)
def test_strange_words_are_refused_in_a_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, argv: list[str], named: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mesh.obj").write_text(MESH)
    assert named in refusal(capsys, *argv).replace("\n", " ")
    assert [each.name for each in tmp_path.iterdir()] == ["mesh.obj"]


def test_the_meshes_of_a_benchmark_are_read_before_anything_is_measured(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench, "collect", lambda: pytest.fail("it measures"))
    assert "'missing.obj' does not exist" in refusal(capsys, "bench", "missing.obj")


def test_memory_that_does_not_suffice_is_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def starved(*_: object) -> None:
        raise MemoryError("Unable to allocate 9 TiB")

    monkeypatch.setattr(bench, "load_mesh", starved)
    assert cli.main(["bench", "mesh.obj"]) == 1
    assert capsys.readouterr().err == (
        "ripple-sim: not enough memory: Unable to allocate 9 TiB; ask for a lower resolution or size\n"
    )


@pytest.mark.parametrize("name", ["model", "look"])
def test_a_nul_in_a_scene_file_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path, name: str) -> None:
    text = {"model": "a.xml", "look": "rubber"} | {name: "a\\u0000b"}
    scene = tmp_path / "scene.toml"
    scene.write_text(f'model = "{text["model"]}"\n[[ripple]]\ngeom = "g"\nlook = "{text["look"]}"\n')
    assert "valid are names without a NUL" in refusal(capsys, "render", str(scene), "-o", str(tmp_path / "x.mp4"))


def test_a_scene_file_nested_without_end_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(f"model = {'[' * 20_000}{']' * 20_000}\n")
    assert "nested too deeply" in refusal(capsys, "render", str(scene), "-o", str(tmp_path / "x.mp4"))
