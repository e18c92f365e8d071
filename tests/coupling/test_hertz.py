"""A hit lasts as Hertz's law says, with the impulse of MuJoCo's contact."""

import inspect

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

    def steps(self, count: int) -> "Fall":
        for _ in range(count):
            RUNS.append(self)
            self.step()
            RUNS.pop()
        return self

    @property
    def total(self) -> float:
        return sum(time * force for time, force in self.loads)


RUNS: list[Fall] = []


@pytest.fixture(autouse=True)
def note_loads(monkeypatch: pytest.MonkeyPatch) -> None:
    step = WaveSolver.step

    def noting(waves, dt, substeps=None, load=None):
        count = int(np.ceil(dt / waves.stable_timestep * (1 - 1e-12)))
        RUNS[-1].loads += [
            (part * dt / count, each.forces.sum()) for part, each in load.parts(dt, count)
        ]
        step(waves, dt, substeps, load)

    monkeypatch.setattr(WaveSolver, "step", noting)


def hertz(modulus: float, radius: float) -> tuple[float, float]:
    """Duration of 90 % of the impulse [s] and greatest force [N] on Hertz's spring."""
    spring = 4 / 3 * modulus * np.sqrt(radius)
    times = np.linspace(0, 4 * (MASS**2 / (radius * modulus**2 * SPEED)) ** 0.2, 4001)
    way, speed = odeint(
        lambda x, _: (x[1], -spring / MASS * max(x[0], 0) ** 1.5), (0, SPEED), times, rtol=1e-10
    ).T
    return np.diff(np.interp([-0.9, 0.9], -speed / SPEED, times))[0], spring * way.max() ** 1.5


def given_time(run: Fall) -> float:
    times, forces = np.array(run.loads).T
    return np.diff(
        np.interp([0.05, 0.95], np.cumsum(times * forces) / run.total, np.cumsum(times))
    )[0]


FLIES = {"speed": SPEED, "solref": ELASTIC}


# 7 ms, which is several physics steps, and 1.1 ms, within one
@pytest.mark.parametrize("modulus", [1e6, 1e8])
def test_ball_on_a_heavy_target_pushes_as_long_and_as_hard_as_by_hertz(modulus):
    run = Fall(height=0.121, modulus=modulus, **FLIES).steps(20)
    time, force = hertz(modulus, RADIUS)
    assert given_time(run) == pytest.approx(time, rel=0.05)
    assert max(force for _, force in run.loads) == pytest.approx(force, rel=0.05)
    assert run.total == pytest.approx(2 * MASS * SPEED, rel=0.02)


def test_peak_with_a_contact_that_gives_less_back_is_lower_as_the_impulse_is():
    """By MuJoCo's default a ball gets a seventh of its speed back."""
    run = Fall(height=0.121, modulus=1e8, speed=SPEED).steps(8)
    force = hertz(1e8, RADIUS)[1]
    share = run.total / (2 * MASS * SPEED)
    assert share == pytest.approx(0.57, abs=0.01)
    assert max(force for _, force in run.loads) == pytest.approx(share * force, rel=0.05)


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
def test_curvatures_of_both_count(target, other, height, radius):
    run = Fall(target=target, other=other, height=height, modulus=1e6, **FLIES).steps(20)
    assert given_time(run) == pytest.approx(hertz(1e6, radius)[0], rel=0.03)


@pytest.mark.parametrize("solref", ["0.02 1", "0.005 0.2", ELASTIC])
def test_the_target_gets_what_mujoco_gives_to_the_last_digits(solref):
    run = Fall(solref=solref).steps(250)  # over several bounces where it bounces
    for _ in range(200):  # what is missing comes when the ball is in the air, or at rest
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


def test_what_is_not_round_keeps_the_contacts_pulse_and_says_so_once():
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
