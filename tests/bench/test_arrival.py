"""Times of arrival: against exact geodesics, and the same for the same object however it lies, is scaled or meshed."""

import numpy as np
import pytest
import trimesh
from known_meshes import known_mesh
from surfaces import disk, joined, moved, torus

from ripple_sim.bench.arrival import (
    arrival,
    arrival_error,
    arrival_times,
    geodesic_distance,
    ideal_width,
    plane_arrival,
    spread_sources,
)
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas, load_mesh, sphere_atlas


def test_front_on_a_sphere_arrives_at_the_distance() -> None:
    atlas = sphere_atlas(1.0, 64)
    width = ideal_width(atlas)
    pole = np.array([0.36, 0.48, 0.8])
    probes = np.random.default_rng(0).standard_normal((500, 3))
    probes /= np.linalg.norm(probes, axis=1, keepdims=True)
    distance = np.arccos(np.clip(probes @ pole, -1, 1))
    probes, distance = probes[(distance > 0.7) & (distance < 2.2)], distance[(distance > 0.7) & (distance < 2.2)]
    times = arrival_times(atlas, pole, probes, width, 2.2)
    for time, expected in zip(times, plane_arrival(distance / width), strict=True):
        assert np.abs(time / (expected * width) - 1).max() < 0.015


def test_waves_arrive_in_time_on_a_body_with_limbs() -> None:
    atlas = build_atlas(Mesh.from_arrays(*limbed()), 96, cache=False)
    for source in spread_sources(atlas, 1):
        error = arrival_error(atlas, source)
        assert error.front_median < 0.005
        assert error.front_under_3_percent > 0.97
        assert error.crest_median < 0.01
        assert error.crest_under_3_percent > 0.95
    # the paper's formula on the same texels
    assert arrival_error(atlas, source, "paper").crest_median > 0.05


@pytest.mark.parametrize("name", ["spot.obj", "bunny.off", "elephant.obj"])
def test_waves_arrive_in_time_on_known_meshes(name: str) -> None:
    atlas = build_atlas(load_mesh(known_mesh(f"good/{name}")), 96, cache=False)
    errors = [arrival_error(atlas, source) for source in spread_sources(atlas, 3)]
    assert np.mean([error.front_median for error in errors]) < 0.01
    # a crest lags by what texels disperse, and by what limbs and furrows bend, however narrow the texels
    assert np.mean([error.crest_median for error in errors]) < 0.012
    assert np.mean([error.front_under_3_percent for error in errors]) > 0.88


def test_same_object_otherwise_presented_has_the_same_times() -> None:
    V, F = limbed()
    mesh = Mesh.from_arrays(V, F)
    atlas = build_atlas(mesh, 96, cache=False)
    source, width, reach = mesh.V[100], ideal_width(atlas), 1.2 * float(np.ptp(mesh.V))
    points = mesh.V[::7]

    def times(other: Atlas, rotation: np.ndarray, scale: float) -> np.ndarray:
        there = scale * points @ rotation.T
        _, directions = other.project(there)
        start, _ = other.project(scale * source @ rotation.T)
        return arrival_times(other, start[0], directions, scale * width, scale * reach)[0] / scale

    unit = np.eye(3)
    reference = times(atlas, unit, 1.0)
    away = np.linalg.norm(points - source, axis=1) > 6 * width
    away &= np.isfinite(reference)
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.2, 0.5, 0.9]))[:3, :3]
    fine_V, fine_F = trimesh.remesh.subdivide(V, F)
    cases = {
        "rotated": (build_atlas(Mesh.from_arrays(V @ turn.T, F), 96, cache=False), turn, 1.0),
        "scaled": (build_atlas(Mesh.from_arrays(37.0 * V, F), 96, cache=False), unit, 37.0),
        "re-meshed": (build_atlas(Mesh.from_arrays(fine_V, fine_F), 96, cache=False), unit, 1.0),
        "doubled resolution": (build_atlas(mesh, 192, cache=False), unit, 1.0),
    }
    for name, case in cases.items():
        change = np.abs(times(*case) / reference - 1)[away]
        assert np.nanmedian(change) < 0.005, name
        assert np.nanquantile(change, 0.9) < 0.01, name


def test_waves_arrive_in_time_on_any_surface_and_not_on_its_other_parts() -> None:
    ring, drum = torus(24), moved(disk(12), (3, 0, 0))
    atlas = build_atlas(joined(ring, drum), 64, cache=False, layout="patches")
    sources = spread_sources(atlas, 3)
    assert max(sources) < len(ring.V)  # on the larger part
    other = len(ring.V) + np.argmin(np.linalg.norm(drum.V - drum.V.mean(axis=0), axis=1))
    for source, own in ((sources[0], ring), (int(other), drum)):
        times = arrival(atlas, source)
        assert 0.5 * len(own.V) < len(times.front) < len(own.V)
        assert np.isfinite(geodesic_distance(atlas.mesh, source)).sum() == len(own.V)
        assert times.error().front_median < 0.01
        assert times.error().front_under_3_percent > 0.8
