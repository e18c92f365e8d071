"""The tables in the documentation come from complete runs with today's operator."""

from pathlib import Path

import numpy as np
import pytest
from eigenvalues import cases, errors_against, mean_error, of_polyhedron
from plates import PLATES, atlas_of, frequencies
from pulsating_sphere import level
from surfaces import sphere
from waveforms import rows

from ripple_sim.solver import build_atlas, load_mesh

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
LIMBED = ROOT / "scenes" / "meshes" / "limbed.obj"
RUNS = {path.stem: path.read_text("utf-8") for path in sorted((DOCS / "runs").glob("*.txt"))}
PAGES = {
    "plates": "validation.md",
    "waveforms": "validation.md",
    "sphere_on_film": "validation.md",
    "pulsating_sphere": "validation.md",
}


@pytest.mark.parametrize("run", RUNS)
def test_the_printed_table_is_the_stored_run(run: str) -> None:
    page = PAGES.get(run, "accuracy.md")
    assert f"```\n{RUNS[run]}```" in (DOCS / page).read_text("utf-8")


@pytest.mark.parametrize("name", ["hemisphere, fixed", "square, free"])
def test_eigenvalues_are_of_todays_operator(name: str) -> None:
    [row] = (line for line in RUNS["eigenvalues"].splitlines() if line.startswith(name))
    texels, error, *_ = row.removeprefix(name).split()
    case = cases()[name]
    atlas = build_atlas(case.mesh(), 32, layout="patches")
    assert f"{atlas.areas.size:,}" == texels
    assert mean_error(atlas, case) == pytest.approx(float(error), rel=0.01)


def test_eigenvalues_of_a_polyhedron_are_of_todays_sphere_map() -> None:
    lines = RUNS["polyhedra"].partition("limbed.obj")[2].splitlines()[1:3]
    mesh = load_mesh(LIMBED)
    errors = errors_against(of_polyhedron(mesh, 1), build_atlas(mesh, 32))
    assert [errors.mean(), errors.max()] == pytest.approx(
        [float(line.split()[3]) for line in lines], rel=0.03
    )


def test_quadratic_elements_have_the_eigenvalues_of_a_flat_square() -> None:
    case = cases()["square, free"]
    np.testing.assert_allclose(
        of_polyhedron(case.mesh(), 0)[1:], np.sort(case.exact)[1:20], rtol=5e-5
    )


def test_waveforms_are_those_of_finite_elements() -> None:
    assert min(float(row[3]) for row in rows("sphere", sphere(4), 16, 6.0)) > 0.9995


def test_levels_of_a_pulsating_sphere_are_of_todays_sound() -> None:
    sizes, *rows = (line.split() for line in RUNS["pulsating_sphere"].splitlines())
    stored = float(rows[1][4:][sizes[2:].index("1.0")])
    assert level(1.0, 10) == pytest.approx(stored, abs=0.06)


@pytest.mark.parametrize(
    "name",
    ["free [Hz], NAFEMS FV12", "cantilever, lambda^2, Barton", "disk, clamped, lambda^2, Leissa"],
)
def test_frequencies_of_plates_are_of_todays_operator(name: str) -> None:
    stored = (
        RUNS["plates"].partition(f"\n{name}")[2].splitlines()[1].removeprefix("  N = 32").split()
    )
    plate = PLATES[name]
    np.testing.assert_allclose(
        frequencies(plate, atlas_of(plate, 32)), np.array(stored, float), rtol=1e-3
    )
