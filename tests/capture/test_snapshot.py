"""Snapshots hold the state of their time, between steps too, and tell states apart; exposures."""

import dataclasses

import mujoco
import numpy as np
import pytest
from exposed_scene import FPS, SPEED, THROW

from ripple_sim.capture import ShutterTimes, Snapshot, disc_points, exposures_of, snapshots
from ripple_sim.scene import CameraEntry
from ripple_sim.simulation import Simulation
from ripple_sim.solver import HeightMap

POKE = (
    '[[poke]]\ngeom = "egg"\ntime = 0.01\npoint = [0.0, 0.0, 0.05]\nimpulse = 1e-4\nradius = 0.02\n'
)
HITTING = '<body name="shot" pos="0 0 0.1005"><freejoint/><geom size="0.05" mass="0.1"/></body>'
DOWN = '[[throw]]\nbody = "shot"\ntime = 0.0\nvelocity = [0, 0, -0.5]\n'


def taken(scene, frames: int, alive: int | None = None) -> list[Snapshot]:
    simulation = Simulation(scene, fps=FPS, backend="cpu")
    return list(snapshots(simulation, frames, alive=frames if alive is None else alive))


def test_each_frame_has_the_state_of_its_own_time(make_scene) -> None:
    scene = make_scene(script=THROW + POKE)
    alone = Simulation(scene, fps=FPS, backend="cpu")
    for number, snapshot in enumerate(taken(scene, 4)):
        if number:
            alone.advance_frame()
        assert (snapshot.number, snapshot.exposure) == (number, 0)
        assert snapshot.data.time == pytest.approx(number / FPS, abs=1e-12)
        np.testing.assert_array_equal(snapshot.data.qpos, alone.data.qpos)
        np.testing.assert_array_equal(snapshot.heights["egg"], alone.ripples["egg"].height)
        height_map = HeightMap(alone.ripples["egg"].atlas.texels)(snapshot.heights["egg"])
        np.testing.assert_array_equal(snapshot.height_maps["egg"], height_map)
    assert snapshot.heights["egg"].any()


def test_only_snapshots_in_use_keep_their_bodies(make_scene) -> None:
    states = taken(make_scene(), 5, alive=2)
    assert len({id(state.data) for state in states}) == 2
    times = [state.data.time for state in states]
    np.testing.assert_allclose(times, np.array([4, 3, 4, 3, 4]) / FPS, atol=1e-12)


def test_impulses_are_reported_once_since_the_previous_frame(make_scene) -> None:
    scene = make_scene(bodies=HITTING, script=DOWN)
    alone = Simulation(scene, fps=FPS, backend="cpu")
    told = 0
    for number, snapshot in enumerate(taken(scene, 3)):
        if number:
            alone.advance_frame()
        assert [each.impulse for each in snapshot.impulses] == [
            each.impulse for each in alone.impulses
        ]
        told += len(snapshot.impulses)
    assert told > 0
    shared = taken(make_scene(bodies=HITTING, script=DOWN, shutter=180.0, exposures=4), 3)
    assert sum(len(each.impulses) for each in shared if each.exposure == 0) == told


def test_the_digest_depends_on_every_bit_of_the_state_and_on_nothing_else(make_scene) -> None:
    scene = make_scene(script=THROW + POKE)
    one = taken(scene, 3)
    same = taken(scene, 3)
    assert [each.digest() for each in one] == [each.digest() for each in same]
    assert len({each.digest() for each in one}) == 3
    last = one[-1]
    for change in ("qpos", "qvel", "heights"):
        data = mujoco.MjData(scene.model)
        heights = {name: each.copy() for name, each in last.heights.items()}
        mujoco.mj_copyData(data, scene.model, last.data)
        array = heights["egg"] if change == "heights" else getattr(data, change)
        copied = dataclasses.replace(last, data=data, heights=heights)
        assert copied.digest() == last.digest()
        array.flat[-1] = np.nextafter(array.flat[-1], array.dtype.type(np.inf))
        assert copied.digest() != last.digest()


@pytest.mark.parametrize("count", [1, 2, 7, 32, 100])
def test_lens_points_fill_the_disc_evenly(count):
    points = disc_points(count)
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=1e-12)
    assert np.linalg.norm(points, axis=1).max(initial=0) <= 1.15
    if count >= 32:
        # of a full disc: a quarter along each axis, nothing between them
        np.testing.assert_allclose(points.T @ points / count, np.eye(2) / 4, atol=0.02)


def test_exposures_are_spread_evenly_over_shutter_time_and_lens():
    assert len(exposures_of(CameraEntry())[0]) == 1
    assert not exposures_of(CameraEntry(shutter=180.0, aperture=0.1, exposures=1))[1].any()
    times, offsets = exposures_of(CameraEntry(shutter=180.0, aperture=0.1, exposures=40))
    np.testing.assert_allclose(times, np.arange(40) / 80)
    # in each quarter of the time, the eye has been all over the lens
    for begin in range(0, 40, 10):
        part = offsets[begin : begin + 10]
        assert np.linalg.norm(part.mean(axis=0)) < 0.015
        assert 0.025 < np.linalg.norm(part, axis=1).mean() < 0.042


def test_states_within_a_step_are_interpolated_and_do_not_change_the_motion(make_scene):
    poke = (
        '[[poke]]\ngeom = "egg"\ntime = 0.02\npoint = [0.0, 0.0, 0.05]\nimpulse = 1e-4\nradius '
        "= 0.02\n"
    )
    scene = make_scene(script=THROW + poke)
    whole, parts = (Simulation(scene, fps=FPS, backend="cpu") for _ in range(2))
    steps = whole.steps_per_frame
    dt = whole.model.opt.timestep
    times = np.array([0, 0.5, 1, 1.25, steps - 0.5, steps])
    shutter_times = ShutterTimes(parts, times / steps)
    for number in range(3):
        begin = whole.data.time
        start = whole.data.body("shot").xpos[1]
        heights = [whole.ripples["egg"].height]
        for _ in range(steps):
            whole.step()
            heights.append(whole.ripples["egg"].height)
        whole.advance_frame()
        for time, (data, shown) in zip(times, shutter_times, strict=True):
            assert data.time == pytest.approx(begin + time * dt, abs=1e-12)
            if number:  # in frame 0 it stands still until the first step
                assert data.body("shot").xpos[1] == pytest.approx(
                    start - SPEED * time * dt, abs=1e-9
                )
            before = heights[int(np.floor(time))]
            after = heights[int(np.ceil(time))]
            np.testing.assert_allclose(
                shown["egg"], before + (time % 1) * (after - before), rtol=1e-5, atol=1e-9
            )
        parts.advance_frame()
        np.testing.assert_array_equal(parts.data.qpos, whole.data.qpos)
        np.testing.assert_array_equal(parts.ripples["egg"].height, whole.ripples["egg"].height)
    assert whole.ripples["egg"].height.any()
