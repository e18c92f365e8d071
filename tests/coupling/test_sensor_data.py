"""Sensors that `add_sensor` puts into a model have their samples in `data.sensordata`."""

import copy
import math
import pickle
import re

import mujoco
import numpy as np
import pytest
from mujoco import rollout

from ripple_sim import Material, RippleError, Ripples, RippleWarning, add_sensor
from ripple_sim.coupling import hooks

DT = 0.002
RATE = 2000.0
SAMPLES = 4  # in a step
STEPS = 60
MODEL = f"""<mujoco><option timestep="{DT}"/><worldbody>
<geom name="bell" type="sphere" size="0.1"/><site name="side" pos="0.1 0 0"/>
<body pos="0 0 0.122"><freejoint/><geom name="ball" size="0.02" mass="0.01"/><site name="off"/>
</body></worldbody></mujoco>"""
FLEX = f"""<mujoco><option timestep="{DT}"/><worldbody><site name="middle"/>
<flexcomp name="sheet" type="grid" dim="2" count="5 5 1" spacing="0.05 0.05 0.05" radius="0.002"
  mass="0.1" rigid="true"/></worldbody></mujoco>"""
MATERIAL = {"bell": Material(speed=20.0, damping=10.0, density=2.0)}


def specification(**options) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_string(MODEL)
    add_sensor(spec, "rim", **({"geom": "bell", "site": "side", "rate": RATE} | options))
    return spec


def rippling(model: mujoco.MjModel, geom: str = "bell") -> Ripples:
    return Ripples(model, {geom: MATERIAL["bell"]}, resolution=8, backend="cpu")


def row(ripples: Ripples, data: mujoco.MjData, name: str = "rim", steps: int = STEPS):
    """The blocks of some steps, in one row."""
    blocks = []
    for _ in range(steps):
        ripples.mj_step(data)
        blocks.append(data.sensor(name).data.copy())
    return np.concatenate(blocks)


@pytest.mark.parametrize("kind", ["acceleration", "velocity"])
def test_sensordata_holds_the_readings_of_the_sensor_delayed_by_its_latency(kind: str) -> None:
    model = specification(kind=kind).compile()
    data = mujoco.MjData(model)
    ripples = rippling(model)
    alone = ripples["bell"].sensor("side", kind, RATE)
    samples = row(ripples, data)
    late = math.ceil(alone.latency * RATE)
    expected = alone.read().values[: len(samples) - late, 0]
    assert np.abs(expected).max() > 0
    assert not samples[:late].any()
    np.testing.assert_array_equal(samples[late:], expected)
    sensor = ripples.sensors["rim"]
    assert (sensor.kind, sensor.rate, sensor.latency) == (kind, RATE, alone.latency)


def test_samples_outlive_mj_forward_and_a_reset_empties_them() -> None:
    model = specification().compile()
    data = mujoco.MjData(model)
    ripples = rippling(model)
    first = row(ripples, data)
    before = data.sensor("rim").data.copy()
    assert before.any()
    mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(data.sensor("rim").data, before)
    ripples.reset()
    assert not data.sensordata.any()
    row(ripples, data, steps=5)
    mujoco.mj_resetData(model, data)
    np.testing.assert_array_equal(row(ripples, data), first)


def test_a_missed_step_does_not_shift_later_samples() -> None:
    model = specification().compile()
    data = mujoco.MjData(model)
    ripples = rippling(model)
    alone = ripples["bell"].sensor("side", rate=RATE)
    row(ripples, data, steps=20)
    mujoco.mj_step(model, data)
    with pytest.warns(RippleWarning, match="2 physics steps were taken"):
        row(ripples, data, steps=1)
    samples = row(ripples, data, steps=20)
    end = 42 * SAMPLES - math.ceil(alone.latency * RATE)
    np.testing.assert_array_equal(samples, alone.read().values[end - len(samples) : end, 0])
    assert samples.any()


def test_one_warning_about_a_changed_time_step_and_blocks_end_at_the_latest_sample() -> None:
    model = specification().compile()
    data = mujoco.MjData(model)
    ripples = rippling(model)
    alone = ripples["bell"].sensor("side", rate=RATE)
    row(ripples, data, steps=40)
    model.opt.timestep = 2 * DT
    with pytest.warns(RippleWarning, match=r"from 0\.002 to 0\.004 s: .* lack samples") as record:
        block = row(ripples, data, steps=2)[-SAMPLES:]
    assert len(record) == 1
    end = 44 * SAMPLES - math.ceil(alone.latency * RATE)
    np.testing.assert_array_equal(block, alone.read().values[end - SAMPLES : end, 0])
    assert block.any()


def test_a_flex_has_sensors() -> None:
    spec = mujoco.MjSpec.from_string(FLEX)
    add_sensor(spec, "middle", geom="sheet", site="middle", kind="velocity", rate=RATE)
    model = spec.compile()
    data = mujoco.MjData(model)
    ripples = rippling(model, "sheet")
    assert np.linalg.norm(ripples.sensors["middle"].points[0]) < 0.01
    ripples.poke("sheet", [0, 0, 0], 1e-4)
    assert row(ripples, data, "middle", steps=30).any()


def test_sensors_survive_xml_and_attach() -> None:
    spec = specification()
    model = spec.compile()
    expected = row(rippling(model), mujoco.MjData(model))
    read_again = mujoco.MjModel.from_xml_string(spec.to_xml())
    np.testing.assert_array_equal(row(rippling(read_again), mujoco.MjData(read_again)), expected)
    parent = mujoco.MjSpec()
    parent.option.timestep = DT
    parent.attach(spec, prefix="left-", frame=parent.worldbody.add_frame())
    attached = parent.compile()
    ripples = rippling(attached, "left-bell")
    samples = row(ripples, mujoco.MjData(attached), "left-rim")
    np.testing.assert_array_equal(samples, expected)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_a_copy_starts_an_empty_row_and_reaches_the_same_samples(copied) -> None:
    model = specification().compile()
    data = mujoco.MjData(model)
    ripples = rippling(model)
    row(ripples, data, steps=20)
    twin = copied(ripples)
    twin_data = copy.copy(data)
    samples = row(ripples, data)
    of_twin = row(twin, twin_data)
    assert not of_twin[:SAMPLES].any() and samples[-SAMPLES:].any()
    np.testing.assert_allclose(
        of_twin[-SAMPLES:], samples[-SAMPLES:], atol=1e-6 * np.abs(samples).max()
    )


def test_a_sensor_on_a_geom_without_ripples_warns_and_reads_0() -> None:
    model = specification(geom="ball", site="off").compile()
    with pytest.warns(RippleWarning, match="'rim' is on 'ball', which does not ripple"):
        ripples = rippling(model)
    assert ripples.sensors == {}
    assert not row(ripples, mujoco.MjData(model), steps=20).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"geom": "gong"}, "no geom, flex or skin 'gong'; its named geoms are 'bell', 'ball'"),
        ({"geom": 0}, "no geom, flex or skin 0"),
        ({"site": "tip"}, "no site 'tip'; its named sites are 'side', 'off'"),
        ({"kind": "jerk"}, "sensor kind must be one of 'acceleration', "),
        ({"rate": 1800.0}, "got 1800 samples a second, which are 3.6 in 0.002 s; take 2000"),
        ({"rate": 1e12}, r"got 1e\+12 samples a second.* take 5e\+07"),
        ({"rate": float("nan")}, "sensor rate must be a finite number greater than 0"),
        ({"kind": "strain"}, "sensor thickness must be"),
    ],
)
def test_invalid_sensors_are_refused(options: dict, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        specification(**options)


def test_a_name_that_is_taken_and_another_time_step_are_refused() -> None:
    spec = specification()
    with pytest.raises(RippleError, match=r"that no other sensor .* has, got 'rim'"):
        add_sensor(spec, "rim", "bell", "side")
    with pytest.raises(RippleError, match=r"spec must be a mujoco\.MjSpec"):
        add_sensor(spec.compile(), "rim", "bell", "side")
    spec.option.timestep = 2 * DT
    with pytest.raises(RippleError, match=r"'rim' has room for 4 samples .* are 8 in"):
        rippling(spec.compile())


def test_a_changed_tuple_is_refused() -> None:
    xml = re.sub(r'prm="2000"', 'prm="-1"', specification().to_xml())
    with pytest.raises(RippleError, match="tuple 'ripple-sim sensor rim' must have"):
        rippling(mujoco.MjModel.from_xml_string(xml))


def rollout_of(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """States and sensor data of ten steps."""
    data = mujoco.MjData(model)
    state = np.zeros((1, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    mujoco.mj_getState(model, data, state[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return rollout.rollout(model, data, state, nstep=10)


def test_a_rollout_warns_once_that_nobody_steps_the_waves(monkeypatch) -> None:
    monkeypatch.setattr(hooks, "_given_rollout_warnings", set())
    model = specification().compile()
    with pytest.warns(RippleWarning, match="has no samples of 'rim'") as warned:
        _, sensors = rollout_of(model)
        rollout_of(model)
    assert len(warned) == 1
    assert warned[0].filename == __file__
    assert not sensors.any()


def test_a_rollout_without_our_sensors_is_silent(recwarn) -> None:
    specification()  # from here on rollouts are watched
    rollout_of(mujoco.MjModel.from_xml_string(MODEL))
    assert not recwarn.list
