"""Which pairs are about to meet too fast, against MuJoCo's own velocities and speeds worked out by hand."""

import mujoco
import numpy as np
import pytest

from ripple_sim.coupling.collision_warnings import APPROACH, too_fast

TIMESTEP = 0.001
TREES = """<mujoco><option gravity="0 0 0"/><worldbody><geom name="still" size="0.1"/>
<body pos="1 0 0"><freejoint/><geom size="0.1" pos="0.2 0.1 0"/>
  <body pos="0.5 0 0"><joint type="hinge" axis="0 1 0"/><geom type="box" size="0.1 0.2 0.1" pos="0 0 0.4"/>
    <body pos="0 0 0.5"><joint type="ball"/><geom type="capsule" size="0.1 0.2" pos="0.1 0.3 0"/></body></body></body>
<body pos="-2 0 1"><joint type="slide" axis="0 0 1"/><geom size="0.2" pos="0 0.3 0"/></body></worldbody></mujoco>"""
TWO_BALLS = """<mujoco><option gravity="0 0 0"/><worldbody><geom size="0.1"/>
<body pos="0 0 1"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"""


def pair(target: int, other: int, *, limit: float = 0.0, at: float = np.inf, stopping_time: float = 0.0) -> tuple:
    return target, other, limit, at, stopping_time


def found_in(
    model: mujoco.MjModel, data: mujoco.MjData, pairs: list[tuple], steps: int = 5
) -> tuple[np.ndarray, np.ndarray]:
    bodies = np.column_stack([model.geom_bodyid, model.body_rootid[model.geom_bodyid]])
    watched = np.array(pairs, APPROACH)
    return too_fast(watched, data.geom_xpos, data.cvel, data.subtree_com, bodies, TIMESTEP, steps)


def flying(velocity: list[float], place: tuple[float, ...] = (0, 0, 1)) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A ball that rests at the origin, and another at a place, with a velocity."""
    model = mujoco.MjModel.from_xml_string(TWO_BALLS)
    data = mujoco.MjData(model)
    data.qpos[:3], data.qvel[:3] = place, velocity
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("seed", range(4))
def test_speeds_of_geoms_on_turning_trees_of_bodies_are_mujocos(seed: int) -> None:
    model = mujoco.MjModel.from_xml_string(TREES)
    data, rng = mujoco.MjData(model), np.random.default_rng(seed)
    mujoco.mj_integratePos(model, data.qpos, rng.uniform(-1, 1, model.nv), 1.0)
    forwards, pairs, seen = rng.uniform(-3, 3, model.nv), np.argwhere(~np.eye(model.ngeom, dtype=bool)), []
    for data.qvel[:] in (forwards, -forwards):
        mujoco.mj_forward(model, data)
        velocities = np.zeros((model.ngeom, 6))
        for geom in range(model.ngeom):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, geom, velocities[geom], 0)
        apart, relative = np.diff(data.geom_xpos[pairs], axis=1)[:, 0], np.diff(velocities[pairs, 3:], axis=1)[:, 0]
        approaching = np.flatnonzero(np.einsum("ij,ij->i", apart, relative) < 0)
        rows, speeds = found_in(model, data, [pair(*each) for each in pairs])
        np.testing.assert_array_equal(rows, approaching)
        np.testing.assert_allclose(speeds, np.linalg.norm(relative[rows], axis=1), rtol=1e-12)
        seen += rows.tolist()
    assert sorted(seen) == list(range(len(pairs))), "what comes nearer goes away when time runs backwards"


@pytest.mark.parametrize(
    ("velocity", "found"),
    [([0, 0, -3], True), ([0, 0, 3], False), ([3, 0, 0], False), ([3, 0, -0.1], True), ([0, 0, 0], False)],
)
def test_only_a_geom_that_comes_nearer_is_found(velocity: list[float], found: bool) -> None:
    rows, speeds = found_in(*flying(velocity), [pair(0, 1)])
    assert rows.tolist() == [0] * found
    np.testing.assert_allclose(speeds, [np.linalg.norm(velocity)] * found)


def test_the_way_within_the_steps_and_one_more_decides_whether_a_geom_is_near() -> None:
    """At 20 m/s five steps of a millisecond, and the one in which the contact is found, are 0.12 m."""
    for place, found in ((0.3 + 0.119, True), (0.3 + 0.121, False)):
        rows, _ = found_in(*flying([0, 0, -20], (0, 0, place)), [pair(0, 1, at=0.3)], steps=5)
        assert (len(rows) == 1) == found
    rows, _ = found_in(*flying([0, 0, -20], (0, 0, 0.3 + 0.121)), [pair(0, 1, at=0.3)], steps=6)
    assert len(rows) == 1


def test_the_depth_of_a_time_step_and_of_stopping_is_held_against_the_limit() -> None:
    """At 10 m/s a geom sinks in by 10 mm in a step, and by 40 mm in 4 ms of stopping: 50 mm in all."""
    rows, _ = found_in(
        *flying([0, 0, -10]),
        [
            pair(0, 1, limit=0.0499, stopping_time=0.004),
            pair(0, 1, limit=0.0501, stopping_time=0.004),
            pair(0, 1, limit=0.0101),
            pair(0, 1, limit=0.0099),
        ],
    )
    assert rows.tolist() == [0, 3]


def test_it_does_not_matter_which_of_two_geoms_is_the_target_or_who_moves() -> None:
    model, data = flying([1, 2, -5])
    rows, speeds = found_in(model, data, [pair(0, 1), pair(1, 0)])
    assert rows.tolist() == [0, 1]
    assert speeds[0] == speeds[1] == pytest.approx(np.sqrt(30))


def test_no_pairs_and_a_state_that_is_not_finite_find_nothing() -> None:
    model, data = flying([0, 0, -5])
    rows, speeds = found_in(model, data, [])
    assert len(rows) == len(speeds) == 0
    data.cvel[1, 3:] = np.nan
    assert not len(found_in(model, data, [pair(0, 1)])[0])
