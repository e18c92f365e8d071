"""Arrival times against exact geodesics, independent of pose, scale and mesh.

The bump's wave on the plane is that of another way to compute it: Poisson's integral of the initial
value problem.
"""

from pathlib import Path

import arrival as fronts
import numpy as np
import pytest
import trimesh
from known_meshes import known_mesh
from scipy.integrate import simpson
from scipy.special import i0e
from surfaces import disk, joined, moved, torus

from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas, load_mesh, sphere_atlas


def test_front_on_a_sphere_arrives_at_the_distance() -> None:
    atlas = sphere_atlas(1.0, 64)
    width = fronts.ideal_width(atlas)
    pole = np.array([0.36, 0.48, 0.8])
    probes = np.random.default_rng(0).standard_normal((500, 3))
    probes /= np.linalg.norm(probes, axis=1, keepdims=True)
    distance = np.arccos(np.clip(probes @ pole, -1, 1))
    probes = probes[(distance > 0.7) & (distance < 2.2)]
    distance = distance[(distance > 0.7) & (distance < 2.2)]
    times = fronts.front_and_crest(*fronts.waves_of(atlas, pole, probes, width, 2.2))
    for time, expected in zip(times, fronts.plane_arrival(distance / width), strict=True):
        assert np.abs(time / (expected * width) - 1).max() < 0.015


def test_waves_arrive_in_time_on_a_body_with_limbs() -> None:
    atlas = build_atlas(Mesh.from_arrays(*limbed()), 96, cache=False)
    for source in fronts.spread_sources(atlas.mesh, 1):
        error = fronts.arrival(atlas, source).error()
        assert error.front_median < 0.005
        assert error.front_under_3_percent > 0.97
        assert error.crest_median < 0.01
        assert error.crest_under_3_percent > 0.95
    # the paper's formula on the same texels
    assert fronts.arrival(atlas, source, "paper").error().crest_median > 0.05


@pytest.mark.parametrize("name", ["spot.obj", "bunny.off", "elephant.obj"])
def test_waves_arrive_in_time_on_known_meshes(name: str) -> None:
    # the bounds are those of the paper's layout, as in the tables
    atlas = build_atlas(load_mesh(known_mesh(f"good/{name}")), 96, layout="cube", cache=False)
    errors = [
        fronts.arrival(atlas, source).error() for source in fronts.spread_sources(atlas.mesh, 3)
    ]
    assert np.mean([error.front_median for error in errors]) < 0.01
    # a crest lags by what texels disperse, and by what limbs and furrows bend, however narrow the
    # texels
    assert np.mean([error.crest_median for error in errors]) < 0.012
    assert np.mean([error.front_under_3_percent for error in errors]) > 0.88


def test_arrival_times_do_not_depend_on_rotation_scale_or_mesh() -> None:
    V, F = limbed()
    mesh = Mesh.from_arrays(V, F)
    atlas = build_atlas(mesh, 64, cache=False)
    source = mesh.V[100]
    width = fronts.ideal_width(atlas)
    reach = 1.2 * float(np.ptp(mesh.V))
    points = mesh.V[::7]

    def front_times(other: Atlas, rotation: np.ndarray, scale: float) -> np.ndarray:
        _, directions = other.project(scale * points @ rotation.T)
        start, _ = other.project(scale * source @ rotation.T)
        waves = fronts.waves_of(other, start[0], directions, scale * width, scale * reach)
        front, _ = fronts.front_and_crest(*waves)
        return front / scale

    def atlas_of(V: np.ndarray, F: np.ndarray, resolution: int = 64) -> Atlas:
        return build_atlas(Mesh.from_arrays(V, F), resolution, cache=False)

    unit = np.eye(3)
    reference = front_times(atlas, unit, 1.0)
    away = np.linalg.norm(points - source, axis=1) > 6 * width
    away &= np.isfinite(reference)
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.2, 0.5, 0.9]))[:3, :3]
    fine_V, fine_F = trimesh.remesh.subdivide(V, F)
    cases = {
        "rotated": (atlas_of(V @ turn.T, F), turn, 1.0),
        "scaled": (atlas_of(37.0 * V, F), unit, 37.0),
        "re-meshed": (atlas_of(fine_V, fine_F), unit, 1.0),
        "doubled resolution": (atlas_of(V, F, 128), unit, 1.0),
    }
    for name, case in cases.items():
        change = np.abs(front_times(*case) / reference - 1)[away]
        assert np.nanmedian(change) < 0.005, name
        assert np.nanquantile(change, 0.9) < 0.01, name


def test_waves_arrive_in_time_on_any_surface_and_not_on_its_other_parts() -> None:
    ring = torus(24)
    drum = moved(disk(12), (3, 0, 0))
    atlas = build_atlas(joined(ring, drum), 64, cache=False, layout="patches")
    sources = fronts.spread_sources(atlas.mesh, 3)
    assert max(sources) < len(ring.V)  # on the larger part
    other = len(ring.V) + np.argmin(np.linalg.norm(drum.V - drum.V.mean(axis=0), axis=1))
    for source, own in ((sources[0], ring), (int(other), drum)):
        times = fronts.arrival(atlas, source)
        assert 0.5 * len(own.V) < len(times.front) < len(own.V)
        assert np.isfinite(fronts.geodesic_distance(atlas.mesh, source)).sum() == len(own.V)
        assert times.error().front_median < 0.01
        assert times.error().front_under_3_percent > 0.8


N = 32


@pytest.fixture(scope="module")
def atlas() -> Atlas:
    return build_atlas(Mesh.from_arrays(*limbed()), N, cache=False)


@pytest.mark.parametrize("operator", ["fem", "dynamic-paint"])
def test_calibration_finds_the_factor_of_a_known_speed(atlas: Atlas, operator: str) -> None:
    source = fronts.spread_sources(atlas.mesh, 1)[0]
    as_it_is = fronts.arrival(atlas, source, operator)
    slow = fronts.arrival(atlas, source, operator, speed=0.7)
    assert fronts.speed_factor([slow]) == pytest.approx(
        fronts.speed_factor([as_it_is]) / 0.7, rel=5e-3
    )


def test_table_has_our_operator_and_its_rivals() -> None:
    rows = fronts.arrivals({}, resolution=N, sources=1)["limbed"]
    paint = rows["dynamic-paint"]
    calibrated = rows[fronts.CALIBRATED]
    conformal = rows[fronts.CONFORMAL]
    # on a grid of squares the sum over 8 neighbours is twice the Laplacian
    assert calibrated["speed factor"] == pytest.approx(np.sqrt(1 / 2), rel=0.1)
    assert calibrated["front_median"] < paint["front_median"] / 2
    assert conformal.keys() == rows["paper"].keys()
    assert conformal != rows["paper"]
    assert rows["fem"]["front_median"] < min(calibrated["front_median"], conformal["front_median"])


def test_the_table_of_a_mesh_with_a_handle_lacks_only_the_sphere_map(tmp_path: Path) -> None:
    ring = torus(16)
    trimesh.Trimesh(ring.V, ring.F, process=False).export(tmp_path / "ring.obj")
    rows = fronts.arrivals({"ring": load_mesh(tmp_path / "ring.obj")}, resolution=24, sources=1)[
        "ring"
    ]
    assert rows.pop(fronts.CONFORMAL) is None
    assert len(rows) == 5
    for name, row in rows.items():
        assert np.isfinite(list(row.values())).all(), name
    assert rows["fem"]["front_median"] < 0.5 * rows["paper"]["front_median"]


TIMES = np.linspace(0, 4, 401)


def bump(middle: float, width: float = 0.3, height: float = 1.0) -> np.ndarray:
    return height * np.exp(-(((TIMES - middle) / width) ** 2) / 2)


def test_the_first_of_two_crests_counts_though_the_second_is_higher() -> None:
    [front], [crest] = fronts.front_and_crest(
        TIMES, (bump(1.0, 0.1, 0.5) + bump(3.0, 0.1))[:, None]
    )
    assert crest == pytest.approx(1.0, abs=1e-4)
    assert front == pytest.approx(1.0 - 0.1 * np.sqrt(2 * np.log(2)), abs=1e-3)


@pytest.mark.parametrize(("height", "expected"), [(0.15, 3.0), (0.25, 1.0)])
def test_a_ripple_below_a_fifth_of_the_strongest_is_no_crest(
    height: float, expected: float
) -> None:
    _, [crest] = fronts.front_and_crest(TIMES, (bump(1.0, 0.1, height) + bump(3.0, 0.1))[:, None])
    assert crest == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    "signal", [np.zeros(401), -bump(2.0), TIMES, -TIMES], ids=["zero", "trough", "rise", "fall"]
)
def test_without_a_crest_there_is_no_time(signal: np.ndarray) -> None:
    for [time] in fronts.front_and_crest(TIMES, signal[:, None]):
        assert np.isnan(time)


FARTHEST = 20.0
SLANTS = np.linspace(0, np.pi / 2, 2001)


def potential(r: float, times: np.ndarray) -> np.ndarray:
    """Integral over s < t of s mean(s) / sqrt(t^2 - s^2), with s = t sin(a).

    mean(s) is the mean over the circle of radius s.
    """
    s = times[:, None] * np.sin(SLANTS)
    return times * simpson(np.sin(SLANTS) * np.exp(-((r - s) ** 2) / 2) * i0e(r * s), x=SLANTS)


@pytest.mark.parametrize("distance", [6.0, 11.0])
def test_front_and_crest_come_when_the_initial_value_problem_says(distance: float) -> None:
    times = distance + np.linspace(-3, 2, 101)
    signal = (potential(distance, times + 1e-3) - potential(distance, times - 1e-3)) / 2e-3
    [expected_front], [expected_crest] = fronts.front_and_crest(times, signal[:, None])
    (front, _), (crest, _) = fronts.plane_arrival(np.array([distance, FARTHEST]))
    assert front == pytest.approx(expected_front, abs=5e-3)
    assert crest == pytest.approx(expected_crest, abs=5e-3)
