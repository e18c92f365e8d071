"""A hit lasts as Hertz's law says, with the impulse of MuJoCo's contact."""

import inspect
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
from hits import Run
from scipy.integrate import odeint

from ripple_sim import Material
from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.solver import WaveSolver

MASS = 0.05
RADIUS = 0.02
FALL = 0.18
SPEED = np.sqrt(2 * 9.81 * FALL)
BLOCK = '<geom name="target" type="box" size=".3 .3 .1" solref="{solref}"/>'
BALL = '<geom name="other" size=".02" mass=".05" solref="{solref}"/>'
# its contact is a spring without a damper
ELASTIC = "-1e5 0"


class Fall(Run):
    """A body falls on a target; records the target's load: times [s] and forces [N]."""

    def __init__(
        self,
        target=BLOCK,
        other=BALL,
        height=0.1 + RADIUS + FALL,
        speed=0.0,
        solref="0.02 1",
        **options,
    ):
        xml = f"""<mujoco><option timestep="0.002" gravity="0 0 {-9.81 * (speed == 0)}"/>
        <worldbody>{target}
            <body pos="0 0 {height}"><freejoint/>{other}</body></worldbody></mujoco>"""
        options = {"resolution": 16, "pulse": "hertz", "modulus": 1e8, **options}
        model = mujoco.MjModel.from_xml_string(xml.format(solref=solref))
        super().__init__(
            model, "target", material=Material(speed=300.0, density=20.0, damping=20.0), **options
        )
        self.data.qvel[2] = -speed
        self.loads: list[tuple[float, float]] = []
        self._record_loads(self.ripples["target"])

    def _record_loads(self, waves: WaveSolver) -> None:
        """Record the load of each substep, and let the waves take it."""
        step = waves.step

        def recording_step(dt, substeps=None, load=None):
            count = int(np.ceil(dt / waves.stable_timestep * (1 - 1e-12)))
            for part, forces in load.parts(dt, count):
                self.loads.append((part * dt / count, forces.forces.sum()))
            step(dt, substeps, load)

        waves.step = recording_step

    def steps(self, count: int) -> "Fall":
        for _ in range(count):
            self.step()
        return self

    @property
    def total(self) -> float:
        return sum(time * force for time, force in self.loads)


class Pulse(NamedTuple):
    """A hit: duration of the middle 90 % of its impulse [s], and greatest force [N]."""

    duration: float
    peak: float


def hertz(modulus: float, radius: float) -> Pulse:
    """The pulse of a ball on Hertz's spring, by an integration of its equation."""
    spring = 4 / 3 * modulus * np.sqrt(radius)
    times = np.linspace(0, 4 * (MASS**2 / (radius * modulus**2 * SPEED)) ** 0.2, 4001)
    way, speed = odeint(
        lambda x, _: (x[1], -spring / MASS * max(x[0], 0) ** 1.5), (0, SPEED), times, rtol=1e-10
    ).T
    # the ball turns round in the middle: at 90 % of its speed 5 % of the impulse are given
    begin, end = np.interp([-0.9, 0.9], -speed / SPEED, times)
    return Pulse(end - begin, spring * way.max() ** 1.5)


def pulse_of(run: Fall) -> Pulse:
    """The pulse that the target got."""
    times, forces = np.array(run.loads).T
    share = np.cumsum(times * forces) / run.total
    begin, end = np.interp([0.05, 0.95], share, np.cumsum(times))
    return Pulse(end - begin, forces.max())


FLIES = {"speed": SPEED, "solref": ELASTIC}


# 7 ms, which is several physics steps, and 1.1 ms, within one
@pytest.mark.parametrize("modulus", [1e6, 1e8])
def test_a_ball_on_a_heavy_target_has_the_duration_and_the_peak_of_hertz(modulus):
    run = Fall(height=0.121, modulus=modulus, **FLIES).steps(20)
    pulse = pulse_of(run)
    exact = hertz(modulus, RADIUS)
    # the force is constant within a 32nd of a physics step, and MuJoCo's contact pays for it
    assert pulse.duration == pytest.approx(exact.duration, rel=0.05)
    assert pulse.peak == pytest.approx(exact.peak, rel=0.05)
    assert run.total == pytest.approx(2 * MASS * SPEED, rel=0.02)


def test_the_peak_of_an_inelastic_hit_is_lower_in_proportion_to_its_impulse():
    """By MuJoCo's default a ball gets a seventh of its speed back."""
    run = Fall(height=0.121, modulus=1e8, speed=SPEED).steps(8)
    share = run.total / (2 * MASS * SPEED)
    assert share == pytest.approx(0.57, abs=0.01)  # (1 + 1 / 7) / 2
    assert pulse_of(run).peak == pytest.approx(share * hertz(1e8, RADIUS).peak, rel=0.05)


SPHERE = '<geom name="target" size=".1" solref="{solref}"/>'
EGG = '<geom name="other" type="ellipsoid" size=".02 .02 .03" mass=".05" solref="{solref}"/>'
PIN = '<geom name="other" type="capsule" size=".02 .05" mass=".05" solref="{solref}"/>'


@pytest.mark.parametrize(
    ("target", "other", "height", "radius"),
    [
        (SPHERE, BALL, 0.121, 1 / (1 / 0.1 + 1 / 0.02)),
        (BLOCK, EGG, 0.131, 0.02**2 / 0.03),
        (BLOCK, PIN, 0.171, 0.02),
    ],
)
def test_the_duration_follows_from_the_curvatures_of_both_bodies(target, other, height, radius):
    run = Fall(target=target, other=other, height=height, modulus=1e6, **FLIES).steps(20)
    assert pulse_of(run).duration == pytest.approx(hertz(1e6, radius).duration, rel=0.03)


@pytest.mark.parametrize("solref", ["0.02 1", "0.005 0.2", ELASTIC])
def test_the_impulse_is_mujocos_to_the_last_digits(solref):
    run = Fall(solref=solref).steps(250)  # over several bounces where it bounces
    for _ in range(200):  # the remainder comes when the ball is in the air, or at rest
        if abs(run.total / run.given() - 1) < 1e-12:
            break
        run.steps(1)
    assert run.total == pytest.approx(run.given(), rel=1e-12)


@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_resting_and_sliding_contacts_stay_as_they_are(speed):
    runs = [Fall(pulse=pulse, height=0.1 + RADIUS) for pulse in ("hertz", "contact")]
    for run in runs:
        run.data.qvel[0] = speed
        run.steps(100)
    assert runs[0].loads == runs[1].loads
    np.testing.assert_array_equal(*(run.ripples["target"].height for run in runs))


def test_a_box_keeps_mujocos_pulse_with_one_warning():
    cube = '<geom name="other" type="box" size=".02 .02 .02" mass=".05" solref="{solref}"/>'
    with pytest.warns(
        RippleWarning, match="'other' on 'target' keeps MuJoCo's contact pulse"
    ) as told:
        run = Fall(other=cube, solref=ELASTIC).steps(220)  # two bounces
    assert [each.filename for each in told if "contact pulse" in str(each.message)] == [
        inspect.getfile(Run)
    ]
    assert run.loads == Fall(pulse="contact", other=cube, solref=ELASTIC).steps(220).loads


def test_gpu_and_processor_agree_and_a_reset_ends_the_pulse():
    runs = [Fall(backend=backend, modulus=1e6).steps(98) for backend in ("cpu", "gl")]
    heights = [run.ripples["target"].height for run in runs]
    assert np.abs(heights[0] - heights[1]).max() < 1e-5 * np.abs(heights[0]).max()
    mujoco.mj_resetData(runs[0].ripples.model, runs[0].data)
    assert runs[0].steps(1).loads[-1][1] == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pulse": "soft"}, "pulse of geom 'target' must be one of 'contact', 'hertz', got 'soft'"),
        (
            {"modulus": None},
            r"modulus of .* must be a finite number greater than 0, got None Pa: E\*",
        ),
        ({"modulus": {"target": -1.0}}, "must be .*, got -1.0 Pa"),
        ({"two_way": True}, "take two_way=False, or pulse='contact'"),
    ],
)
def test_invalid_pulses_are_refused(options, message):
    with pytest.raises(SceneError, match=message):
        Fall(**options)
