"""The tables in the documentation come from complete runs with today's operator."""

from pathlib import Path

import numpy as np
import pytest
from eigenvalues import cases, errors_against, mean_error, of_polyhedron
from plates import PLATES, atlas_of, frequencies
from pulsating_sphere import level
from surfaces import sphere
from waveforms import comparisons

from ripple_sim.solver import build_atlas, load_mesh

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
LIMBED = ROOT / "scenes" / "meshes" / "limbed.obj"
RUNS = sorted((DOCS / "runs").glob("*.txt"))
PAGES = {
    "plates": "validation.md",
    "waveforms": "validation.md",
    "sphere_on_film": "validation.md",
    "pulsating_sphere": "validation.md",
}


def stored(name: str) -> str:
    """The output of a run, as it is kept."""
    return (DOCS / "runs" / f"{name}.txt").read_text("utf-8")


@pytest.mark.parametrize("run", RUNS, ids=lambda path: path.stem)
def test_the_printed_table_is_the_stored_run(run: Path) -> None:
    page = PAGES.get(run.stem, "accuracy.md")
    assert f"```\n{stored(run.stem)}```" in (DOCS / page).read_text("utf-8")


@pytest.mark.parametrize("name", ["hemisphere, fixed", "square, free"])
def test_eigenvalues_are_of_todays_operator(name: str) -> None:
    [row] = (line for line in stored("eigenvalues").splitlines() if line.startswith(name))
    texels, error, *_finer = row.removeprefix(name).split()
    case = cases()[name]
    atlas = build_atlas(case.mesh(), 32, layout="patches")
    assert f"{atlas.areas.size:,}" == texels
    assert mean_error(atlas, case) == pytest.approx(float(error), rel=0.01)


def test_eigenvalues_of_a_polyhedron_are_of_todays_sphere_map() -> None:
    _, _, of_limbed = stored("polyhedra").partition("limbed.obj")
    _, mean_line, worst_line, *_ = of_limbed.splitlines()
    # "cube, mean", texels, error, and those of finer atlases
    _, _, _, mean, *_ = mean_line.split()
    _, _, _, worst, *_ = worst_line.split()
    mesh = load_mesh(LIMBED)
    errors = errors_against(of_polyhedron(mesh, 1), build_atlas(mesh, 32))
    # sphere maps of other machines differ a little
    assert [errors.mean(), errors.max()] == pytest.approx([float(mean), float(worst)], rel=0.03)


def test_quadratic_elements_have_the_eigenvalues_of_a_flat_square() -> None:
    case = cases()["square, free"]
    np.testing.assert_allclose(
        of_polyhedron(case.mesh(), 0)[1:], np.sort(case.exact)[1:20], rtol=5e-5
    )


def test_waveforms_are_those_of_finite_elements() -> None:
    compared = comparisons("sphere", sphere(4), 16, 6.0)
    assert min(each.correlation for each in compared) > 0.9995


def test_levels_of_a_pulsating_sphere_are_of_todays_sound() -> None:
    heading, _, at_10_radii, _ = stored("pulsating_sphere").splitlines()
    sizes = heading.removeprefix("k R").split()
    levels = at_10_radii.removeprefix("r = 10 R").removesuffix("dB").split()
    printed = dict(zip(sizes, levels, strict=True))["1.0"]
    assert level(1.0, 10) == pytest.approx(float(printed), abs=0.06)  # of one decimal


@pytest.mark.parametrize(
    "name",
    ["free [Hz], NAFEMS FV12", "cantilever, lambda^2, Barton", "disk, clamped, lambda^2, Leissa"],
)
def test_frequencies_of_plates_are_of_todays_operator(name: str) -> None:
    _, _, of_plate = stored("plates").partition(f"\n{name}")
    _, of_coarse, *_ = of_plate.splitlines()
    printed = np.array(of_coarse.removeprefix("  N = 32").split(), float)
    plate = PLATES[name]
    found = frequencies(plate, atlas_of(plate, 32))
    np.testing.assert_allclose(found, printed, rtol=1e-3)  # of three decimals
