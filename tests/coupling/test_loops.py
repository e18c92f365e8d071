"""Users' loops: the waves get each impulse once, and a reset resets them."""

import copy
import types
import warnings
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from ripple_sim import Material, RippleError, Ripples, RippleWarning

N = 16
GRAVITY = 9.81
MASS = 0.3
BALL = f"""<mujoco model="bounce"><option timestep="0.001"/><worldbody>
<geom name="block" type="box" size="0.5 0.5 0.2" pos="0 0 -0.2" solref="0.01 0.3"/>
<body name="ball" pos="0.03 0.02 0.06"><freejoint/>
<geom size="0.05" mass="{MASS}" solref="0.01 0.3"/></body>
</worldbody><keyframe><key name="late" time="3" qpos="0 0 0.049 1 0 0 0"/></keyframe></mujoco>"""

Loop = Callable[[Ripples, mujoco.MjModel, mujoco.MjData], None]


def bounce(**options: object) -> tuple[Ripples, mujoco.MjModel, mujoco.MjData]:
    """A ball about to fall on a block."""
    model = mujoco.MjModel.from_xml_string(BALL)
    material = Material(speed=1.0, density=100.0)
    return (
        Ripples(model, {"block": material}, resolution=N, backend="cpu", **options),
        model,
        mujoco.MjData(model),
    )


def plain(ripples: Ripples, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    for _ in range(5):
        mujoco.mj_step(model, data)
        ripples.step(data)


def own_steps(ripples: Ripples, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    ripples.mj_step(data, nstep=5)


def in_halves(ripples: Ripples, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    for _ in range(5):
        mujoco.mj_step1(model, data)
        mujoco.mj_step2(model, data)
        ripples.step(data)


def followed(ripples: Ripples, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    with ripples.following(data):
        mujoco.mj_step(model, data, nstep=4)
        mujoco.mj_step1(model, data)
        mujoco.mj_step2(model, data)
        mujoco.mj_step1(model, data)


def wrapped(ripples: Ripples, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    ripples.mj_step(types.SimpleNamespace(ptr=data), nstep=5)


@pytest.mark.parametrize("two_way", [False, True])
@pytest.mark.parametrize("loop", [own_steps, in_halves, followed, wrapped])
def test_every_loop_makes_the_waves_of_the_plain_loop(loop: Loop, two_way: bool) -> None:
    expected = bounce(two_way=two_way)
    found = bounce(two_way=two_way)
    with warnings.catch_warnings(action="error", category=RippleWarning):
        for _ in range(40):
            plain(*expected)
            loop(*found)
    assert np.abs(expected[0]["block"].height).max() > 1e-4
    np.testing.assert_array_equal(found[0]["block"].height, expected[0]["block"].height)
    np.testing.assert_array_equal(found[2].qpos, expected[2].qpos)


@pytest.mark.parametrize("loop", [own_steps, followed])
def test_impulses_of_several_steps_add_up_to_the_momentum_gained(loop: Loop) -> None:
    ripples, model, data = bounce()
    given = 0.0
    for _ in range(30):
        loop(ripples, model, data)
        given += sum(impulse.impulse for impulse in ripples.last_impulses)
    gained = MASS * (data.qvel[2] + GRAVITY * data.time)
    assert given == pytest.approx(gained, rel=2e-3)


def test_one_warning_counts_missed_steps() -> None:
    ripples, model, data = bounce()
    given = 0.0
    said = r"5 physics steps .* other 4; call `ripples.mj_step\(data, nstep=5\)`"
    with pytest.warns(RippleWarning, match=said) as told:
        for _ in range(30):
            mujoco.mj_step(model, data, nstep=5)
            ripples.step(data)
            given += sum(impulse.impulse for impulse in ripples.last_impulses)
    assert len(told) == 1
    assert told[0].filename == __file__
    # the waves get the part that is known: the force of the latest step over this step
    assert given == pytest.approx(MASS * (data.qvel[2] + GRAVITY * data.time) / 5, rel=0.3)
    assert ripples["block"].time == pytest.approx(data.time - 4 * model.opt.timestep)


def test_mujocos_functions_are_restored_after_following() -> None:
    ripples, model, data = bounce()
    before = mujoco.mj_step, mujoco.mj_step2
    with pytest.raises(ZeroDivisionError), ripples.following(data):
        assert mujoco.mj_step is not before[0]
        with ripples.following(data):
            mujoco.mj_step(model, data)
        1 / 0  # noqa: B018
    assert (mujoco.mj_step, mujoco.mj_step2) == before


def test_following_one_data_ignores_steps_of_others() -> None:
    ripples, model, data = bounce()
    other = mujoco.MjData(model)
    with ripples.following(data):
        mujoco.mj_step(model, other, nstep=3)
    assert other.time == pytest.approx(3 * model.opt.timestep)
    assert ripples["block"].time == 0


def test_forces_are_solved_if_mujoco_has_not_solved_them_yet() -> None:
    """dm_control's loop ends with mj_step1, so the contacts are those of the next step."""
    ripples, model, data = bounce()
    given = 0.0
    mujoco.mj_step1(model, data)
    with pytest.warns(RippleWarning, match="between `mj_step1` and `mj_step2`") as told:
        for _ in range(150):
            mujoco.mj_step2(model, data)
            mujoco.mj_step1(model, data)
            ripples.step(data)
            given += sum(impulse.impulse for impulse in ripples.last_impulses)
    assert len(told) == 1
    mujoco.mj_step2(model, data)  # with the forces that the ripples knew already
    assert given == pytest.approx(MASS * (data.qvel[2] + GRAVITY * data.time), rel=2e-3)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
@pytest.mark.parametrize("two_way", [False, True])
def test_forces_lost_to_a_new_collision_are_found_again(two_way: bool, integrator: str) -> None:
    """`mj_collision` takes the rows of the constraint solver away."""
    waves = []
    places = []
    with warnings.catch_warnings(action="error", category=RippleWarning):
        for collide in (False, True):
            ripples, model, data = bounce(two_way=two_way)
            model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
            for _ in range(200):
                mujoco.mj_step(model, data)
                if collide:
                    mujoco.mj_collision(model, data)
                ripples.step(data)
            waves.append(ripples["block"].height)
            places.append(data.qpos.copy())
    np.testing.assert_allclose(waves[1], waves[0], atol=1e-4 * np.abs(waves[0]).max())
    np.testing.assert_allclose(places[1], places[0], atol=1e-6)


def test_warning_about_forces_that_cannot_be_recomputed() -> None:
    """With poses of the coming step its forces are taken."""
    ripples, model, data = bounce()
    given = 0.0
    with pytest.warns(
        RippleWarning, match="`mj_collision`, called after `mj_step`, throws them away"
    ) as told:
        for _ in range(200):
            mujoco.mj_step(model, data)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_collision(model, data)
            ripples.step(data)
            given += sum(impulse.impulse for impulse in ripples.last_impulses)
    assert len(told) == 1
    assert given > 0.5 * MASS * (data.qvel[2] + GRAVITY * data.time)


def test_data_of_another_model_is_refused() -> None:
    ripples, _, _ = bounce()
    other = mujoco.MjModel.from_xml_string(
        '<mujoco model="chair"><worldbody><geom size="1"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(other)
    for call in (ripples.step, ripples.mj_step):
        with pytest.raises(
            RippleError, match=r"another model \('chair', nq 0.*\) than .* \('bounce', nq 7"
        ):
            call(data)
    with pytest.raises(RippleError, match=r"data must be .*, got NoneType"):
        ripples.step(None)


def spoilt(ripples: Ripples) -> None:
    """Waves that no simulation made."""
    ripples["block"].velocity = np.random.default_rng(3).standard_normal((6, N, N))


@pytest.mark.parametrize("unseen", [1, 2, 60])
@pytest.mark.parametrize("keyframe", [None, 0])
def test_waves_begin_anew_with_the_simulation(unseen: int, keyframe: int | None) -> None:
    """Even where the time after the reset is that before it, or later."""
    ripples, model, data = bounce()
    mujoco.mj_step(model, data)
    ripples.step(data)
    spoilt(ripples)
    if keyframe is None:
        mujoco.mj_resetData(model, data)
    else:
        mujoco.mj_resetDataKeyframe(model, data, keyframe)
    mujoco.mj_step(model, data, nstep=unseen)
    ripples.step(data)
    fresh = bounce()[0]
    fresh.step(data)
    np.testing.assert_array_equal(ripples["block"].velocity, fresh["block"].velocity)
    assert ripples["block"].time == model.opt.timestep


def test_a_diverged_simulation_resets_the_waves_with_a_warning(in_tmp_path: None) -> None:
    ripples, model, data = bounce()
    own_steps(ripples, model, data)
    with pytest.warns(RippleWarning, match=r"diverged \(mjWARN_BADQVEL\): MuJoCo reset it") as told:
        for _ in range(2):
            spoilt(ripples)
            data.qvel[0] = 1e12
            mujoco.mj_step(model, data)
            ripples.step(data)
            assert not ripples["block"].velocity.any()
            plain(ripples, model, data)
    assert len(told) == 1


@pytest.mark.parametrize("loop", [plain, own_steps, followed])
def test_a_warning_names_the_line_that_steps(loop: Loop, in_tmp_path: None) -> None:
    ripples, model, data = bounce()
    plain(ripples, model, data)
    data.qvel[0] = 1e12
    with pytest.warns(RippleWarning, match="diverged") as told:
        loop(ripples, model, data)
    assert [each.filename for each in told] == [__file__]


@pytest.mark.parametrize("two_way", [False, True])
def test_a_state_with_nan_makes_no_waves(two_way: bool, in_tmp_path: None) -> None:
    """With its automatic reset disabled: NaN positions once ended in an error about points."""
    ripples, model, data = bounce(two_way=two_way)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    plain(ripples, model, data)
    spoilt(ripples)
    data.qpos[2] = np.nan
    with pytest.warns(
        RippleWarning, match=r"diverged \(mjWARN_BADQPOS\): its automatic reset is disabled"
    ) as told:
        plain(ripples, model, data)
    assert len(told) == 1
    assert not ripples["block"].velocity.any()
    mujoco.mj_resetData(model, data)
    for _ in range(40):
        plain(ripples, model, data)
    assert ripples["block"].velocity.any()


def test_a_teleported_body_is_no_reset() -> None:
    ripples, model, data = bounce()
    own_steps(ripples, model, data)
    spoilt(ripples)
    data.qpos[:3] = 0.0, 0.0, 5.0
    mujoco.mj_step(model, data)
    ripples.step(data)
    assert ripples["block"].velocity.any()


def said_by(run: Callable[[], None]) -> list[str]:
    """The warnings of a run."""
    with warnings.catch_warnings(record=True, action="always", category=RippleWarning) as said:
        run()
    return [str(each.message) for each in said]


@pytest.mark.parametrize("copied", [False, True])
def test_warning_about_two_data_stepped_in_turn(copied: bool) -> None:
    """Copies carry the mark of what they were copied from, and others marks of their own."""
    ripples, model, data = bounce()
    ripples.mj_step(data)
    other = copy.copy(data) if copied else mujoco.MjData(model)

    def in_turn() -> None:
        for _ in range(4):
            ripples.mj_step(other)
            ripples.mj_step(data)

    assert [
        message for message in said_by(in_turn) if "make one Ripples for each MjData" in message
    ] != []
    assert said_by(in_turn) == []


def test_no_warning_about_several_data_of_one_simulation() -> None:
    """A new MjData each episode, one that is reset, and two that take turns."""
    ripples, model, first = bounce()
    second = mujoco.MjData(model)

    def episodes() -> None:
        for data in (first, second):
            ripples.mj_step(data, nstep=3)
        mujoco.mj_resetData(model, first)
        ripples.mj_step(first, nstep=3)
        for here, there in 2 * [(first, second), (second, first)]:
            mujoco.mj_copyData(there, model, here)
            ripples.mj_step(there)

    assert said_by(episodes) == []
    assert ripples["block"].time == pytest.approx(7 * model.opt.timestep)


@pytest.mark.parametrize("flag", ["contact", "constraint"])
@pytest.mark.parametrize("at_run_time", [False, True])
def test_warning_about_contacts_that_the_model_disables(flag: str, at_run_time: bool) -> None:
    ripples, model, data = bounce()
    bit = int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}"))
    if at_run_time:
        assert said_by(lambda: ripples.mj_step(data, nstep=3)) == []
    model.opt.disableflags |= bit
    (message,) = said_by(lambda: ripples.mj_step(data, nstep=60))
    assert f'<flag {flag}="disable"/>' in message
    exec(message.split("or call ")[1], {"model": model, "mujoco": mujoco})
    ripples.mj_step(data, nstep=60)
    assert model.opt.disableflags == 0 and ripples["block"].height.any()
