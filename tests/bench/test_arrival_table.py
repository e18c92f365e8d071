"""Calibration finds a known speed, and the paper's map stands beside ours."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from surfaces import torus

from ripple_sim.bench.arrival import (
    CALIBRATED,
    CONFORMAL,
    Arrival,
    arrival,
    arrivals,
    mean_error,
    speed_factor,
    spread_sources,
)
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas, load_mesh

N = 32


@pytest.fixture(scope="module")
def atlas() -> Atlas:
    return build_atlas(Mesh.from_arrays(*limbed()), N, cache=False)


@pytest.mark.parametrize("operator", ["fem", "dynamic-paint"])
def test_calibration_finds_the_factor_of_a_known_speed(atlas: Atlas, operator: str) -> None:
    source = spread_sources(atlas, 1)[0]
    as_it_is = arrival(atlas, source, operator)
    slow = arrival(atlas, source, operator, speed=0.7)
    assert speed_factor([slow]) == pytest.approx(speed_factor([as_it_is]) / 0.7, rel=5e-3)


def test_waves_at_the_calibrated_speed_arrive_as_calibration_says(atlas: Atlas) -> None:
    source = spread_sources(atlas, 1)[0]
    as_it_is = arrival(atlas, source, "dynamic-paint")
    factor = speed_factor([as_it_is])
    again = arrival(atlas, source, "dynamic-paint", speed=factor)
    assert speed_factor([again]) == pytest.approx(1, abs=5e-3)
    for name, error in mean_error([again]).items():
        assert error == pytest.approx(mean_error([as_it_is.at_speed(factor)])[name], abs=0.02), name


def test_a_constant_delay_is_calibrated_away_and_no_crest_is_not() -> None:
    late = Arrival(np.full(9, 1.25), np.full(9, 1.25))
    assert mean_error([late])["front_median"] == pytest.approx(0.25)
    assert speed_factor([late]) == 1.25
    assert max(mean_error([late.at_speed(1.25)])[key] for key in ("front_median", "crest_q90")) == 0
    none = Arrival(np.array([1.0, np.nan, np.nan]), np.array([1.0, np.nan, np.nan]))
    assert speed_factor([none]) == 1
    assert none.error().front_median == 1


def test_table_has_our_operator_and_its_rivals() -> None:
    rows = arrivals({}, resolution=N, sources=1)["limbed"]
    paint, calibrated, conformal = rows["dynamic-paint"], rows[CALIBRATED], rows[CONFORMAL]
    # on a grid of squares the sum over 8 neighbours is twice the Laplacian
    assert calibrated["speed factor"] == pytest.approx(np.sqrt(1 / 2), rel=0.1)
    assert calibrated["front_median"] < paint["front_median"] / 2
    assert conformal.keys() == rows["paper"].keys()
    assert conformal != rows["paper"]
    assert rows["fem"]["front_median"] < min(calibrated["front_median"], conformal["front_median"])


def test_a_mesh_with_a_handle_has_no_sphere_map_and_all_else(tmp_path: Path) -> None:
    ring = torus(16)
    trimesh.Trimesh(ring.V, ring.F, process=False).export(tmp_path / "ring.obj")
    rows = arrivals({"ring": load_mesh(tmp_path / "ring.obj")}, resolution=24, sources=1)["ring"]
    assert rows.pop(CONFORMAL) is None
    assert len(rows) == 5
    for name, row in rows.items():
        assert np.isfinite(list(row.values())).all(), name
    assert rows["fem"]["front_median"] < 0.5 * rows["paper"]["front_median"]
