"""Rays find the nearest surface."""

import numpy as np
import pytest
from played import MIDDLE, RADIUS, run

from ripple_sim.viewer.opening import open_scene
from ripple_sim.viewer.session import Session


def test_a_ray_finds_the_surface_where_geometry_says(session: Session) -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        origin = MIDDLE + 3 * rng.standard_normal(3) / np.sqrt(3)
        if np.linalg.norm(origin - MIDDLE) < 1:
            continue
        toward = MIDDLE + 0.3 * rng.uniform(-1, 1, 3) - origin
        hit = session.pick(origin, toward)
        assert hit is not None
        # |o + t d| = R
        local = origin - MIDDLE
        a, b, c = toward @ toward, local @ toward, local @ local - RADIUS**2
        assert hit.distance == pytest.approx((-b - np.sqrt(b * b - a * c)) / a, rel=3e-3)
    assert session.pick([3, 0, 0.5], [1, 0, 0]) is None
    assert session.pick([3, 0, 2.5], [-1, 0, 0]) is None


def test_a_ray_finds_the_nearest_of_two_turned_and_moved_surfaces() -> None:
    session = Session(open_scene("pair"), resolution=16)
    run(session, 4)
    data, ids = session.simulation.data, session.simulation.ripples.geom_ids
    left, right = (data.geom_xpos[ids[name]] for name in ("left", "right"))
    along = (right - left) / np.linalg.norm(right - left)
    for start, way, name in ((left - 2 * along, along, "left"), (right + 2 * along, -along, "right")):
        hit = session.pick(start, way)
        assert hit is not None
        assert hit.geom == name
        atlas = session.simulation.ripples[name].atlas
        closest, _ = atlas.project(hit.point)
        assert np.linalg.norm(closest[0] - hit.point) < 1e-3  # triangles in a ball
        # carried back to the world the point lies on the ray
        world = data.geom_xpos[ids[name]] + data.geom_xmat[ids[name]].reshape(3, 3) @ hit.point
        np.testing.assert_allclose(world, start + hit.distance * way, atol=1e-6)
