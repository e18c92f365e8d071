"""Waves too high or too steep: a warning once a target, with a material that would do."""

import dataclasses
import re
import tomllib
import warnings
from pathlib import Path

import gymnasium
import msgspec
import mujoco
import numpy as np
import pytest
from mujoco_models import limbed_asset

from ripple_sim import Material, Ripples
from ripple_sim.errors import RippleWarning
from ripple_sim.scene.material_entry import MaterialEntry

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


def advised(message: str) -> Material:
    """The material that a warning names, in Python and in TOML alike."""
    found = re.search(r"would do: Material\((.*)\), in a scene file (material = .*)$", message)
    assert found is not None, message
    coefficients = dict(pair.split("=") for pair in found[1].split(", "))
    entry = tomllib.loads(found[2])["material"]
    assert entry == {name: float(value) for name, value in coefficients.items()}
    return msgspec.convert(entry, MaterialEntry).material()


@pytest.mark.parametrize(
    ("xml", "material"),
    [
        (BALL, WEAK),
        (BALL, Material(density=1.0)),
        (BALL, Material.plate(modulus=1e4)),
        (BALL, Material(speed=0.6, stiffness=100.0, density=1.0, yield_height=0.01)),
        (ON_ANIMAL, Material.jelly()),
    ],
    ids=["weak", "density alone", "plate", "plastic", "jelly"],
)
def test_a_hard_hit_is_reported_once_and_the_named_material_would_do(xml: str, material: Material) -> None:
    [message], light = warned(xml, material)
    assert "geom 'target' are too high" in message
    heavier = advised(message)
    given = light["target"].material
    for name in ("speed", "damping", "stiffness", "viscosity", "bending", "yield_height"):
        assert getattr(heavier, name) == pytest.approx(getattr(given, name), rel=1e-3)
    messages, ripples = warned(xml, heavier)
    assert messages == []
    assert ripples["target"].height.any()


@pytest.mark.filterwarnings("ignore:MuJoCo. compiler attribute 'settotalmass'")
@pytest.mark.parametrize("material", [Material(density=1.0), Material(speed=0.3, damping=1, stiffness=300, density=5)])
def test_what_is_named_for_a_foot_holds_under_other_steps_too(material: Material) -> None:
    assets = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
    model = mujoco.MjModel.from_xml_path(str(assets / "half_cheetah.xml"))

    def messages(material: Material, seed: int) -> list[str]:
        data, rng = mujoco.MjData(model), np.random.default_rng(seed)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            ripples = Ripples(model, {"ffoot": material}, resolution=16, backend="cpu")
            for _ in range(30):
                data.ctrl[:] = rng.uniform(-1, 1, model.nu)
                ripples.mj_step(data, 5)
            ripples.reset()
        return [str(each.message) for each in caught if "the waves on" in str(each.message)]

    [message] = messages(material, seed=0)
    heavier = advised(message)
    assert all(messages(heavier, seed) == [] for seed in range(3))


def test_what_is_named_is_whole_where_the_model_chose_the_material() -> None:
    model, data, ripples = still_ripples(Material())
    ripples.poke("target", [0, 0, 0.5], 200.0, 0.1)
    with pytest.warns(RippleWarning) as caught:
        run(model, data, ripples, 80)
    heavier, chosen = advised(str(caught[0].message)), ripples["target"].material
    for name in ("speed", "damping", "stiffness"):
        assert getattr(heavier, name) == pytest.approx(getattr(chosen, name), rel=1e-3)
    model, data, ripples = still_ripples(heavier)
    ripples.poke("target", [0, 0, 0.5], 200.0, 0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(model, data, ripples, 80)


def test_a_crest_of_any_step_is_reported() -> None:
    model, data, ripples = still_ripples()
    run(model, data, ripples, 18)
    ripples["target"].height = 0.4
    run(model, data, ripples, 1)
    ripples["target"].height = 0.0
    with pytest.warns(RippleWarning, match="0.4 m at .* radius is 0.5 m"):
        run(model, data, ripples, 40)


def test_crests_of_waves_with_an_old_material_are_reported() -> None:
    model, data, ripples = still_ripples()
    run(model, data, ripples, 2)
    ripples["target"].height = 0.4
    run(model, data, ripples, 1)
    ripples.change_material("target", damping=2.0)
    ripples["target"].height = 0.0
    with pytest.warns(RippleWarning, match="0.4 m at .* radius is 0.5 m"):
        run(model, data, ripples, 40)


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


def test_of_a_map_a_factor_is_named() -> None:
    model, data, ripples = still_ripples()
    ripples.change_material("target", density=np.full(ripples["target"].atlas.areas.shape, 2.0))
    ripples["target"].height = 0.4
    with pytest.warns(RippleWarning) as caught:
        run(model, data, ripples, 80)
    [message] = [str(each.message) for each in caught]
    call = re.search(r"would do: (ripples\.change_material\('target', density=[\d.]+ \* .*)$", message)
    assert call is not None, message
    before = ripples["target"].material.density
    exec(call[1], {"ripples": ripples})
    assert (ripples["target"].material.density > 4 * before).all()
