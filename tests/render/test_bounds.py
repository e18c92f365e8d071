"""Bounding balls."""

import numpy as np

from ripple_sim.render.camera import Balls, balls_about, enclosing, join, within


def test_balls_about_triangles_hold_each_and_are_small() -> None:
    random = np.random.default_rng(5)
    angle = random.uniform(0, 2 * np.pi, 300)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(300)], axis=1)
    triangles = ring[:, None] + random.normal(size=(300, 3, 3)) * 0.02
    centres, radii = balls_about(triangles, 16)
    inside = np.linalg.norm(triangles[:, :, None] - centres, axis=3) <= radii + 1e-12
    assert inside.all(axis=1).any(axis=1).all()
    assert len(radii) == 16
    assert radii.max() < 0.4


def test_fewer_triangles_than_balls() -> None:
    triangles = np.random.default_rng(6).normal(size=(3, 3, 3))
    centres, radii = balls_about(triangles, 16)
    middles = (triangles.min(axis=1) + triangles.max(axis=1)) / 2
    np.testing.assert_allclose(np.sort(centres, axis=0), np.sort(middles, axis=0))
    assert len(radii) == 3


def random_balls(count: int) -> Balls:
    random = np.random.default_rng(7)
    return Balls(random.normal(size=(count, 3)), random.uniform(0.1, 0.5, count))


def test_the_enclosing_ball_contains_every_ball() -> None:
    balls = random_balls(9)
    centre, radius = enclosing(balls)
    assert (np.linalg.norm(balls.centres - centre, axis=1) + balls.radii <= radius + 1e-12).all()
    assert enclosing(Balls(balls.centres[:1], balls.radii[:1]))[1] == balls.radii[0]


def test_balls_within_reach_are_those_that_it_touches() -> None:
    balls = join(random_balls(40), Balls(np.array([[9.0, 0.0, 0.0]]), np.array([np.inf])))
    near = within(balls, np.zeros(3), 1.0)
    gap = np.linalg.norm(balls.centres, axis=1) - balls.radii
    np.testing.assert_array_equal(near.radii, balls.radii[gap < 1.0])
    assert 1 < len(near.radii) < 40
