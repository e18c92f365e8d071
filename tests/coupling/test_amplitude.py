"""Waves too high or too steep: a warning once a target, with a density that would do."""

import dataclasses
import re
import warnings

import mujoco
import numpy as np
import pytest
from mujoco_models import limbed_asset

from ripple_sim import Material, Ripples
from ripple_sim.errors import RippleWarning

BALL = """<mujoco><option timestep="0.002"/><worldbody>
    <geom name="target" type="sphere" size="0.5"/>
    <body pos="0 0 0.56"><freejoint/><geom type="sphere" size="0.05" mass="0.36"/></body>
    </worldbody></mujoco>"""

ON_ANIMAL = f"""<mujoco><option timestep="0.002" sdf_initpoints="8"/><asset>{limbed_asset()}</asset><worldbody>
    <geom name="target" type="sdf" mesh="limbed"/>
    <body pos="0.03 0 0.55"><freejoint/><geom type="sphere" size="0.05" mass="1.7"/></body>
    </worldbody></mujoco>"""

WEAK = Material(speed=0.6, damping=1.0, stiffness=0.0, density=1.0)


def warned(xml: str, material: Material, seconds: float = 0.5, backend: str = "cpu") -> tuple[list[str], Ripples]:
    """Messages of a ball that falls on the target at 4.5 m/s, and the ripples afterwards."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qvel[2] = -4.5
    ripples = Ripples(model, {"target": material}, resolution=32, backend=backend)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(round(seconds / 0.002)):
            mujoco.mj_step(model, data)
            ripples.step(data)
    assert all(issubclass(each.category, RippleWarning) for each in caught)
    return [str(each.message) for each in caught], ripples


def named_density(message: str) -> float:
    found = re.search(r"would do: ([\d.e+]+) kg/m\^2", message)
    assert found is not None, message
    return float(found[1])


@pytest.mark.parametrize(("xml", "material"), [(BALL, WEAK), (ON_ANIMAL, Material.jelly())])
def test_a_hard_hit_is_reported_once_and_the_named_density_would_do(xml: str, material: Material) -> None:
    [message], _ = warned(xml, material)
    assert "geom 'target' are too high" in message
    heavier = dataclasses.replace(material, density=named_density(message))
    messages, ripples = warned(xml, heavier)
    assert messages == []
    assert ripples["target"].height.any()


def test_gl_is_looked_at_too(opengl: None) -> None:
    [message], _ = warned(BALL, WEAK, seconds=1.0, backend="gl")
    assert "geom 'target' are too" in message


def test_waves_within_bounds_are_not_reported() -> None:
    messages, ripples = warned(BALL, dataclasses.replace(WEAK, density=1000.0))
    assert messages == [] and ripples["target"].height.any()


def still_ripples(material: Material = WEAK) -> tuple[mujoco.MjModel, mujoco.MjData, Ripples]:
    model = mujoco.MjModel.from_xml_string(BALL)
    model.opt.gravity[:] = 0
    return model, mujoco.MjData(model), Ripples(model, {"target": material}, resolution=32, backend="cpu")


def run(model: mujoco.MjModel, data: mujoco.MjData, ripples: Ripples, steps: int) -> None:
    for _ in range(steps):
        mujoco.mj_step(model, data)
        ripples.step(data)


def test_steep_waves_are_reported_although_they_are_low() -> None:
    model, data, ripples = still_ripples(Material(speed=1e-3, damping=0.0, stiffness=0.0, density=1.0))
    z = ripples["target"].atlas.positions[..., 2]
    ripples["target"].height = (0.05 * np.sin(40 * z)).astype(np.float32)
    with pytest.warns(RippleWarning, match="too steep: a slope of 1.* on "):
        run(model, data, ripples, 80)


def test_a_reset_reports_what_is_still_being_followed() -> None:
    model, data, ripples = still_ripples()
    ripples["target"].height = 0.4
    run(model, data, ripples, 16)
    with pytest.warns(RippleWarning, match="0.4 m at .* radius is 0.5 m"):
        ripples.reset()


def test_a_reset_reports_what_was_never_looked_at() -> None:
    model, data, ripples = still_ripples()
    run(model, data, ripples, 1)
    ripples["target"].height = 0.4
    with pytest.warns(RippleWarning, match="0.4 m at .* radius is 0.5 m"):
        ripples.reset()


def test_a_target_may_have_any_height_if_that_is_wanted() -> None:
    model, data, ripples = still_ripples()
    ripples.allow_any_height("target")
    ripples["target"].height = 0.4
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(model, data, ripples, 80)


def test_a_density_map_is_named_by_its_factor() -> None:
    model, data, ripples = still_ripples()
    ripples.change_material("target", density=np.full(ripples["target"].atlas.areas.shape, 2.0))
    ripples["target"].height = 0.4
    with pytest.warns(RippleWarning, match="as high would do: as much more"):
        run(model, data, ripples, 80)
