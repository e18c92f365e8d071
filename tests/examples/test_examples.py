"""The examples run as they stand without a warning, and make the pictures that they promise."""

import importlib.util
import json
import os
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

# Waves of an example are no higher than its objects allow, and it does nothing else that the package warns of.
pytestmark = pytest.mark.filterwarnings("error::ripple_sim.errors.RippleWarning")

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(name: str, monkeypatch, folder: Path, *arguments: str) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main()


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("own_loop", []),
        ("several_targets", []),
        ("robot_arm", []),
        ("painted_speed", []),
        ("own_deformation", []),
        ("gymnasium_ant", []),
        ("gymnasium_humanoid", []),
        ("batch_impulses", ["--scenes", "2", "--seconds", "0.8", "--workers", "1"]),
    ],
)
def test_an_example_makes_its_picture(name, arguments, monkeypatch, tmp_path, capsys):
    if name.startswith("gymnasium"):
        pytest.importorskip("gymnasium")
    run(name, monkeypatch, tmp_path, *arguments)
    assert f"out/{name}.png" in capsys.readouterr().out
    with Image.open(tmp_path / "out" / f"{name}.png") as picture:
        assert np.asarray(picture.convert("L")).std() > 10


def test_a_skin_shows_the_ripples_to_mujocos_own_renderer(tmp_path):
    # in a process of its own: that renderer takes the OpenGL context away
    command = [sys.executable, str(EXAMPLES / "passive_viewer.py"), "--picture"]
    subprocess.run(command, cwd=tmp_path, env={**os.environ, "MUJOCO_GL": "egl"}, check=True, capture_output=True)
    before, _, after = np.split(np.asarray(Image.open(tmp_path / "out" / "passive_viewer.png")).astype(int), 3, axis=1)
    crown = slice(110, 150), slice(200, 250)  # beside the shadow of the ball

    def bend(frame):
        return np.minimum(np.abs(np.diff(frame[crown].sum(axis=2), 2, axis=0)), 40).mean()

    assert bend(after) > 1.5 * bend(before)  # crests and troughs on what was smooth


def test_the_mesh_that_any_mesh_writes_is_displaced(monkeypatch, tmp_path):
    import trimesh

    from ripple_sim.scenes.shapes import LIMBED_FILE
    from ripple_sim.solver import load_mesh

    run("any_mesh", monkeypatch, tmp_path)
    mesh, written = load_mesh(LIMBED_FILE), trimesh.load(tmp_path / "out" / "any_mesh.ply", process=False)
    moved = written.vertices - mesh.V
    along = (moved * mesh.vertex_normals).sum(axis=1)
    assert np.allclose(moved, along[:, None] * mesh.vertex_normals, atol=1e-6)
    assert (tmp_path / "out" / "any_mesh.png").is_file()
    assert 1e-3 < np.abs(along).max() < 0.05


def test_the_notebook_runs_from_top_to_bottom(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    shown = []
    display = types.SimpleNamespace(Video=lambda path, embed: shown.append(path))
    monkeypatch.setitem(sys.modules, "IPython", types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    cells = json.loads((EXAMPLES / "ripples.ipynb").read_text())["cells"]
    names = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert "highest ripple" in capsys.readouterr().out
    assert shown == ["sphere.mp4"]
    assert (tmp_path / "sphere.mp4").stat().st_size > 1000
