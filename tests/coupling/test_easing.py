"""Easing takes the whole of a light load, and of a heavy load no more than the limit."""

import numpy as np
import pytest
import trimesh

from ripple_sim.coupling.easing import Easing, EasingLaw
from ripple_sim.solver import Mesh, build_atlas, sphere_atlas
from ripple_sim.solver.operator.suited_law import depth_under

DT = 0.001
LAW = EasingLaw(most=10.0, rate=50.0, thickness=1.0)
BODIES = np.array([0, 1, 1, 2])
ATLAS = sphere_atlas(resolution=8)


def taken_up(forces: list[float], collider: int = 1, easing: Easing | None = None) -> np.ndarray:
    """What is taken up of forces that one collider holds, step by step [N]."""
    easing = easing or Easing(LAW, BODIES, ATLAS)
    at = np.array([0])
    return np.array(
        [
            force * easing.shares(np.array([collider]), at, np.array([force]), DT)[0]
            for force in forces
        ]
    )


def test_easing_leaves_light_hits_and_weights_unchanged() -> None:
    # 0.2 N s, at a rate of 50 a second as much as 10 N, less what fades
    hit = [100.0] * 2 + [0.0] * 50
    np.testing.assert_array_equal(taken_up(hit), hit)
    weight = [9.0] * 500
    np.testing.assert_array_equal(taken_up(weight), weight)


def test_easing_limits_the_impulse_of_any_heavy_hit_to_the_same_value() -> None:
    impulses = [DT * taken_up([force] * 5).sum() for force in (1e3, 1e4, 1e6)]
    # the most over the rate, and what fades in five steps
    assert impulses == pytest.approx([LAW.most / LAW.rate] * 3, rel=0.3)
    assert np.ptp(impulses) < 0.2 * impulses[0]
    assert taken_up([1e6] * 500)[-1] == pytest.approx(LAW.most)


def test_each_body_is_eased_separately_and_recovers_during_a_pause() -> None:
    easing = Easing(LAW, BODIES, ATLAS)
    colliders = np.array([0, 1, 2, 3])
    texels = np.zeros(4, np.int64)
    shares = easing.shares(colliders, texels, np.array([1.0, 1e5, 1e5, 1.0]), DT)
    assert shares[0] == shares[3] == 1.0 and shares[1] == shares[2] < 0.01, (
        "colliders 1 and 2 are one body"
    )
    assert taken_up([100.0], easing=easing)[0] < 50.0
    easing.pause(1.0)
    assert taken_up([100.0], easing=easing)[0] == 100.0
    assert easing.least_share < 0.01


def test_pulling_counts_as_pushing() -> None:
    np.testing.assert_allclose(taken_up([-1e5] * 9), -taken_up([1e5] * 9))


def test_the_greatest_eased_force_dents_a_fixed_share_of_the_thickness() -> None:
    of = {"radius": 0.05, "density": 30.0, "speed": 2.0, "stiffness": 900.0}
    law = EasingLaw.of(0.2, 0.3, **of)
    assert depth_under(law.most, **of) == pytest.approx(0.06)
    assert law.rate == 30.0


def test_the_thinnest_place_within_a_dent_limits_the_force() -> None:
    """A ring runs from a thick place into a thin one beside it."""
    V = np.array([[x, y, z] for x in (0, 2) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    V[4:, 2] *= 0.1  # a wedge
    atlas = build_atlas(Mesh.from_arrays(V, trimesh.convex.convex_hull(V).faces), 16, cache=False)
    top = atlas.positions.reshape(-1, 3)
    place = np.array([np.linalg.norm(top - [0.4, 0.0, 0.4], axis=1).argmin()])
    forces = []
    for reach in (0.01, 0.8):
        law = EasingLaw(most=10.0, rate=50.0, thickness=0.5, reach=reach)
        easing = Easing(law, BODIES, atlas)
        shares = easing.shares(np.array([1]), place, np.array([1e6]), 1.0)
        forces.append(1e6 * shares[0])
    near, far = forces
    assert near > 1.5 * far > 1.0
