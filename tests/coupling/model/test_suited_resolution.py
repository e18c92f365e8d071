"""The resolution that a model chooses: by what touches the target, and by the time step."""

import mujoco
import pytest

from ripple_sim import Material, Ripples, Simulation, load_scene

EGG = """<mujoco><option timestep="{dt}"/><worldbody><geom name="egg" type="ellipsoid" size="{a} {a} {b}"/>
    <body pos="0 0 {start}"><freejoint/><geom type="sphere" size="{ball}"/></body></worldbody></mujoco>"""


def chosen(material: Material, scale: float = 1.0, dt: float = 0.002, ball: float = 0.1) -> Ripples:
    """Ripples on an egg of a longest extent of `scale` [m]."""
    xml = EGG.format(dt=dt, a=0.35 * scale, b=0.5 * scale, start=scale, ball=ball * scale)
    return Ripples(mujoco.MjModel.from_xml_string(xml), {"egg": material}, backend="cpu")


@pytest.mark.parametrize("scale", [0.04, 1.0, 30.0])
def test_a_chosen_material_takes_few_substeps_on_an_egg_of_any_size(scale: float) -> None:
    waves = chosen(Material(), scale)["egg"]
    assert 32 <= waves.atlas.resolution <= 256
    waves.step(0.002)
    assert waves.substeps_taken <= 4


def test_fast_waves_on_a_small_egg_get_fewer_texels() -> None:
    slow = chosen(Material(speed=0.04, density=1.0), 0.04)["egg"].atlas.resolution
    fast = chosen(Material(speed=1.0, density=1.0), 0.04)["egg"].atlas.resolution
    assert (slow, fast) == (96, 32)
    shorter = chosen(Material(speed=1.0, density=1.0), 0.04, dt=0.0004)["egg"].atlas.resolution
    assert 32 < shorter < 96


def test_a_small_body_gets_texels_that_resolve_its_footprint() -> None:
    waves = chosen(Material(speed=0.5, density=1.0), ball=0.03)["egg"]
    assert waves.atlas.resolution > 96
    assert waves.atlas.areas.mean() ** 0.5 < 0.5 * 0.03 / 3.5


def test_a_resolution_that_is_given_is_the_one_that_is_taken() -> None:
    model = mujoco.MjModel.from_xml_string(EGG.format(dt=0.002, a=0.3, b=0.5, start=1, ball=0.1))
    for given in (24, {"egg": 24}):
        assert Ripples(model, {"egg": Material()}, resolution=given, backend="cpu")["egg"].atlas.resolution == 24
    assert Ripples(model, {"egg": Material()}, resolution={"egg": None}, backend="cpu")["egg"].atlas.resolution >= 32
    assert Simulation(load_scene("sphere"), resolution=16).ripples["sphere"].atlas.resolution == 16
