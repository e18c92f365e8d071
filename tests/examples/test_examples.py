"""Examples: every file can be imported and runs, in a smaller version if it is long."""

import importlib.util
import json
import os
import re
import sys
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from programs import ended

from ripple_sim.scenes.shapes import LIMBED_FILE
from ripple_sim.solver import load_mesh

EXAMPLES = Path(__file__).parents[2] / "examples"
FILES = sorted(each.relative_to(EXAMPLES).as_posix() for each in EXAMPLES.rglob("*.py"))
# constants that make it quick, arguments of main, and what it then prints
SMALL: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "step_hook.py": ({}, {"duration": 1 / 60}, "1 frames in"),
    "compare_operators.py": ({"SIZE": 60, "RESOLUTION": 16}, {}, "out/compare_operators.png"),
    "gymnasium_feeling_foot.py": ({}, {}, "step 19: "),
    "gymnasium_tapped_place.py": ({"DROPS": 48}, {}, "100% of 16 taps"),
    "sphere_on_film.py": ({"STEP": 4e-5, "RESOLUTIONS": (16,)}, {}, "greatest depth 0."),
    "benchmarks/finite_guard.py": ({"TIMES": 3}, {}, "| 256 |"),
    "benchmarks/loops.py": ({}, {}, "1.0000"),
    "benchmarks/export.py": (
        {"RESOLUTION": 16, "TRIANGLES": 1000, "WARM_UP": 1},
        {"frames": 3},
        "frames a second",
    ),
}
PICTURES = (
    "own_loop several_targets robot_arm painted_speed own_deformation gymnasium_ant "
    "gymnasium_humanoid"
)
# Waves of an example are no higher than its objects allow, and it does nothing else that the
# package warns of.
without_warnings = pytest.mark.filterwarnings("error::ripple_sim.errors.RippleWarning")


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """An empty working folder; modules imported from an example's folder are removed again."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["example"])
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        if EXAMPLES in Path(getattr(sys.modules[name], "__file__", None) or "/").parents:
            del sys.modules[name]


@pytest.fixture
def imported(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    """Import a file of examples; its constants may be changed."""

    def run(file: str, **constants: Any) -> ModuleType:
        if file.startswith("gymnasium"):
            pytest.importorskip("gymnasium")
        path = EXAMPLES / file
        monkeypatch.syspath_prepend(str(path.parent))
        spec = importlib.util.spec_from_file_location(path.stem, path)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, path.stem, module)  # dataclasses look themselves up
        spec.loader.exec_module(module)
        for name, value in constants.items():
            monkeypatch.setattr(module, name, value)
        return module

    return run


@pytest.mark.parametrize("file", FILES)
def test_importing_an_example_has_no_side_effects(
    file: str, folder: Path, imported, capsys
) -> None:
    gl = os.environ.get("MUJOCO_GL")
    imported(file)
    assert capsys.readouterr() == ("", "")
    assert not list(folder.iterdir())
    assert os.environ.get("MUJOCO_GL") == gl


@pytest.mark.parametrize("file", SMALL)
def test_a_small_version_of_an_example_runs(file: str, imported, capsys) -> None:
    constants, arguments, says = SMALL[file]
    imported(file, **constants).main(**arguments)
    assert says in capsys.readouterr().out


def test_a_part_of_the_paper_is_made(folder: Path, imported) -> None:
    part = imported("paper/figure_8.py", TIMES=[0.05], SIZE=(64, 48)).make(folder)
    assert len(part.pictures) == 3
    assert all(picture.is_file() for picture, _ in part.pictures)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("wave_fronts", {"resolution": 16, "size": 40}),
        ("energy", {"steps": 200, "resolution": 16}),
        ("convergence", {"resolutions": (8, 12)}),
        ("dispersion", {"texels": 24}),
        ("decay", {"texels": 24}),
        ("gelatine_ring", {"texels": 24}),
    ],
)
def test_a_plot_is_written(name: str, options: dict[str, Any], folder: Path, imported) -> None:
    picture = np.asarray(
        Image.open(imported(f"plots/{name}.py").make(folder, **options)).convert("RGB")
    )
    assert picture.shape[1] > 900
    assert picture.std() > 10


@without_warnings
@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        *((name, "") for name in PICTURES.split()),
        ("batch_impulses", "--scenes 2 --seconds 0.6 --workers 1"),
    ],
)
def test_an_example_makes_its_picture(
    name: str, arguments: str, folder: Path, imported, monkeypatch, capsys
) -> None:
    monkeypatch.setattr(sys, "argv", [name, *arguments.split()])
    imported(f"{name}.py").main()
    assert f"out/{name}.png" in capsys.readouterr().out
    with Image.open(folder / "out" / f"{name}.png") as picture:
        assert np.asarray(picture.convert("L")).std() > 10


def test_a_ring_on_gelatine_comes_when_the_exact_one_does(imported) -> None:
    plot = imported("plots/gelatine_ring.py")
    texels = 96
    (modulus, _) = plot.MEASURED["gelatine-5"]
    speed = plot.RAYLEIGH * np.sqrt(modulus / plot.DENSITY)
    times = np.linspace(0, 0.2 / speed, 151)[1:]
    distances = plot.SIDE / texels * np.arange(texels // 2)
    exact = plot.exact_ring(modulus, distances, times)
    ours, long = (plot.spread("gelatine-5", texels, times, short) for short in (True, False))
    due, came, late = (
        plot.leading_crest(each, distances, times, speed)[0] for each in (exact, ours, long)
    )
    np.testing.assert_allclose(came, due, rtol=0.04)
    assert np.abs(came / due - 1).mean() < 0.5 * np.abs(late / due - 1).mean()


def test_mujocos_renderer_ours_and_a_plotter_end_without_a_crash(opengl: None) -> None:
    result = ended(
        EXAMPLES / "benchmarks" / "exit_order.py", "mujoco", "ours", "pyvista", timeout=300
    )
    assert "| mujoco, ours, pyvista | 0 | 0 |" in result.stdout
    assert result.returncode == 0, result.stderr


@without_warnings
def test_the_mesh_that_any_mesh_writes_is_displaced(folder: Path, imported) -> None:
    imported("any_mesh.py").main()
    mesh = load_mesh(LIMBED_FILE)
    written = trimesh.load(folder / "out" / "any_mesh.ply", process=False)
    moved = written.vertices - mesh.V
    along = (moved * mesh.vertex_normals).sum(axis=1)
    assert np.allclose(moved, along[:, None] * mesh.vertex_normals, atol=1e-6)
    assert (folder / "out" / "any_mesh.png").is_file()
    assert 1e-3 < np.abs(along).max() < 0.05


@without_warnings
def test_the_notebook_runs_from_top_to_bottom(folder: Path, monkeypatch, capsys) -> None:
    shown = []
    display = types.SimpleNamespace(Video=lambda path, embed: shown.append(path))
    monkeypatch.setitem(sys.modules, "IPython", types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    names: dict[str, Any] = {}
    for cell in json.loads((EXAMPLES / "ripples.ipynb").read_text())["cells"]:
        if cell["cell_type"] == "code":
            source = "".join(cell["source"])
            # the video takes longest
            exec(
                re.sub(r"size=.*?, duration=[\d.]+", "size=(64, 48), fps=10, duration=0.3", source),
                names,
            )
    assert "highest ripple" in capsys.readouterr().out
    assert shown == ["sphere.mp4"]
    assert (folder / "sphere.mp4").stat().st_size > 1000
