"""What a model chooses for a material that leaves it open: waves that suit the target, whatever the scale.

The resolution that a model chooses: by what touches the target, and by the time step.
"""

import math
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest
from known_meshes import known_mesh

from ripple_sim import Material, Ripples, Simulation, load_scene
from ripple_sim.solver import load_mesh
from ripple_sim.solver.texels.thickness import half_thickness

BOX = """<mujoco><option timestep="0.002"/><worldbody><geom name="target" type="box" size="0.5 0.5 0.25"/>
    <body pos="0 0 0.36"><freejoint/><geom type="box" size="0.15 0.15 0.1" mass="{mass}"/></body>
    </worldbody></mujoco>"""

# a ball of 0.14 times the target's size, from a height of half the size
FALL = """<mujoco><option timestep="{dt}"/><worldbody><geom name="target" type="sphere" size="{half}"/>
    <body pos="0 0 {start}"><freejoint/><geom type="sphere" size="{radius}" density="500"/></body>
    </worldbody></mujoco>"""


def highest(model: mujoco.MjModel, material: Material, seconds: float, **options: object) -> tuple[float, Ripples]:
    """Greatest height [m]; any warning is an error."""
    ripples, data = Ripples(model, {"target": material}, backend="cpu", **options), mujoco.MjData(model)
    top = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(round(seconds / model.opt.timestep)):
            mujoco.mj_step(model, data)
            ripples.step(data)
            top = max(top, float(np.abs(ripples["target"].height).max()))
    return top, ripples


def cow_under_ball() -> mujoco.MjModel:
    """A cow of 1 m, and a ball of 0.36 kg that falls on it at 4.5 m/s."""
    mesh = load_mesh(known_mesh("good/spot.obj"))
    V = mesh.V[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    V /= np.ptp(V, axis=0).max()
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.sdf_initpoints = 0.002, 8
    spec.add_mesh(name="target", uservert=V.ravel(), userface=mesh.F.ravel())
    spec.worldbody.add_geom(name="target", type=mujoco.mjtGeom.mjGEOM_SDF, meshname="target")
    body = spec.worldbody.add_body(pos=[0.0, 0.0, V[:, 2].max() + 1.09])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0, 0], mass=0.36)
    return spec.compile()


@pytest.mark.parametrize("material", [Material(), Material(speed=0.6, damping=1.0)])
def test_a_ball_on_a_cow_makes_waves_of_a_few_centimetres(material: Material) -> None:
    top, ripples = highest(cow_under_ball(), material, 0.9, resolution=48)
    assert 0.005 < top < 0.05
    chosen = ripples["target"].material
    assert chosen.unset == () and chosen.density > 10 and chosen.stiffness > 100


def test_a_heavy_box_comes_to_rest_in_a_shallow_pit() -> None:
    model = mujoco.MjModel.from_xml_string(BOX.format(mass=20))
    top, ripples = highest(model, Material(), 1.5, resolution=24)
    assert 1e-5 < top < 0.01
    assert np.abs(ripples["target"].velocity).max() < 0.01


@pytest.mark.parametrize("size", [5e-3, 0.02, 1.0, 30.0, 1e3])
def test_waves_suit_the_target_at_every_scale(size: float) -> None:
    dt = 0.002 * min(1.0, math.sqrt(size))
    xml = FALL.format(dt=dt, half=size / 2, start=1.08 * size, radius=0.07 * size)
    top, _ = highest(mujoco.MjModel.from_xml_string(xml), Material(), 0.45 * math.sqrt(size), resolution=24)
    assert 1e-4 * size < top < 0.1 * size


def test_density_is_the_bodys_mass_over_the_targets_area_if_steps_are_short() -> None:
    xml = """<mujoco><option timestep="1e-5"/><worldbody><geom name="still" type="sphere" size="0.3"/>
    <body pos="0 0 2"><freejoint/><geom name="free" type="sphere" size="0.5" mass="7"/></body></worldbody></mujoco>"""
    ripples = Ripples(
        mujoco.MjModel.from_xml_string(xml), {"still": Material(), "free": Material()}, resolution=8, backend="cpu"
    )
    assert ripples["free"].material.density == pytest.approx(7 / (4 * np.pi * 0.25), rel=0.01)
    # the world has no mass: 1000 kg/m^3 times volume over area
    assert ripples["still"].material.density == pytest.approx(1000 * 0.3 / 3, rel=0.01)


def test_long_steps_have_less_stiffness_and_more_density() -> None:
    found = []
    for dt in (1e-5, 1e-3, 1e-2):
        model = mujoco.MjModel.from_xml_string(BOX.format(mass=20))
        model.opt.timestep = dt
        found.append(Ripples(model, {"target": Material()}, resolution=8, backend="cpu")["target"].material)
        assert math.sqrt(found[-1].stiffness) * dt < 0.5001
    free, short, long = found
    assert free.density == pytest.approx(1000 * 0.5 / 4, rel=0.01)
    assert free.stiffness > short.stiffness > long.stiffness
    assert short.density < long.density


def test_a_given_stiffness_is_made_up_for_by_the_density() -> None:
    model = mujoco.MjModel.from_xml_string(BOX.format(mass=20))
    top, ripples = highest(model, Material(stiffness=0.0), 0.5, resolution=24)
    assert ripples["target"].material.stiffness == 0.0
    assert top < 0.25 * 0.25


# a ball that falls hard, from many times its size, on something heavy
FROM_HIGH = """<mujoco><option timestep="{dt}"/><worldbody><geom type="plane" size="9 9 1"/>
    <body pos="0 0 3"><freejoint/><geom name="target" size="0.15" density="1000" solref="0.004 0.5"/></body>
    <body pos="0.05 0 0.6"><freejoint/><geom type="box" size="0.4 0.4 0.2" mass="90"/></body></worldbody></mujoco>"""


def cheetah(dt: float) -> mujoco.MjModel:
    """Gymnasium's, with another time step."""
    model = mujoco.MjModel.from_xml_path(
        str(Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "half_cheetah.xml")
    )
    model.opt.timestep = dt
    return model


@pytest.mark.parametrize("dt", [5e-4, 2e-3, 1e-2])
@pytest.mark.parametrize(
    ("make", "targets", "seconds"),
    [
        (cheetah, ("ffoot", "bfoot"), 0.6),
        (lambda dt: mujoco.MjModel.from_xml_string(FROM_HIGH.format(dt=dt)), ("target",), 1.2),
    ],
    ids=["cheetah", "ball"],
)
@pytest.mark.filterwarnings("ignore:MuJoCo. compiler attribute 'settotalmass'")
def test_heights_stay_within_a_quarter_of_the_radius_at_every_time_step(
    make: Callable[[float], mujoco.MjModel], targets: Sequence[str], seconds: float, dt: float
) -> None:
    model, rng = make(dt), np.random.default_rng(3)
    data, ripples = (
        mujoco.MjData(model),
        Ripples(model, dict.fromkeys(targets, Material()), resolution=16, backend="cpu"),
    )
    for name in targets:
        ripples.allow_any_height(name)
        ripples[name].crests()
    radii = {name: half_thickness(ripples[name].atlas) for name in targets}
    for step in range(round(seconds / dt)):
        if step % max(1, round(0.05 / dt)) == 0:
            data.ctrl[:] = rng.uniform(-1, 1, model.nu)
        ripples.mj_step(data)
    for name in targets:
        assert 0 < (np.abs(ripples[name].crests()) / radii[name]).max() < 0.25


def test_what_is_given_stays_and_a_density_says_that_all_is_given() -> None:
    model = mujoco.MjModel.from_xml_string(BOX.format(mass=1))

    def chosen(material: Material) -> Material:
        return Ripples(model, {"target": material}, resolution=8, backend="cpu")["target"].material

    kept = chosen(Material(speed=0.7, stiffness=3.0, viscosity=0.1))
    assert (kept.speed, kept.stiffness, kept.viscosity) == (0.7, 3.0, 0.1)
    assert kept.damping > 0 and kept.density != 1.0
    for whole in (Material(density=1.0), Material.jelly(), Material.suited(1.0, 2.0)):
        assert chosen(whole) is whole


def test_a_heavier_body_is_met_by_a_stiffer_surface_and_no_body_by_the_least_stiffness() -> None:
    found = []
    for mass in (1e-6, 20.0, 1000.0):
        model = mujoco.MjModel.from_xml_string(BOX.format(mass=mass))
        model.opt.timestep = 1e-4
        found.append(Ripples(model, {"target": Material()}, resolution=8, backend="cpu")["target"].material.stiffness)
    assert found[0] == pytest.approx((16 * 4.43 / 1.0) ** 2, rel=0.01)
    assert found[0] < found[1] < found[2]
    # without gravity too
    model.opt.gravity[:] = 0
    weightless = Ripples(model, {"target": Material()}, resolution=8, backend="cpu")["target"].material
    assert np.isfinite(weightless.stiffness) and weightless.stiffness > found[0] / 2


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
