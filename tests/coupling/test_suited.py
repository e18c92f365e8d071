"""Material and resolution chosen by the model, and warnings of waves too high or steep."""

import dataclasses
import math
import re
import tomllib
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import gymnasium
import msgspec
import mujoco
import numpy as np
import pytest
from genus_zero import icosphere
from hits import Run
from mujoco_models import limbed_asset

from ripple_sim import Material, Ripples, Simulation, Target, load_scene
from ripple_sim.coupling.suited import _is_intricate
from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.scene import MaterialEntry
from ripple_sim.solver import Mesh
from ripple_sim.solver.texels import half_thickness

BOX = """<mujoco><option timestep="0.002"/><worldbody>
<geom name="target" type="box" size="0.5 0.5 0.25"/>
    <body pos="0 0 0.36"><freejoint/><geom type="box" size="0.15 0.15 0.1" mass="{mass}"/></body>
    </worldbody></mujoco>"""

RAIN = """<mujoco><worldbody><geom name="target" size="0.5"/>{}</worldbody></mujoco>"""
FALLING = '<body pos="0 0 1.6"><freejoint/><geom size="{}" mass="{}"/></body>'


def test_the_suited_preset_takes_size_and_typical_hit_from_the_model(tmp_path: Path) -> None:
    bodies = "".join(
        FALLING.format(radius, mass) for radius, mass in ((0.05, 0.2), (0.08, 0.5), (0.2, 9.0))
    )
    (tmp_path / "rain.xml").write_text(RAIN.format(bodies))
    (tmp_path / "nothing.xml").write_text(RAIN.format(""))
    scene = tmp_path / "scene.toml"

    def chosen(model: str, preset: str) -> Material:
        scene.write_text(
            f'model = "{model}"\n[[ripple]]\ngeom = "target"\nmaterial = {{preset = {preset}}}'
        )
        return load_scene(scene).targets[0].material.material()

    # all of it is left to the model
    assert chosen("rain.xml", '"suited"').unset == Material().unset
    # the body of median mass, 1.6 m - 0.5 m - 0.08 m above the target, or a fall of its size
    expected = Material.suited(1.0, (0.5, (2 * 9.81 * 1.02) ** 0.5), radius=0.04)
    for name in ("density", "stiffness", "speed", "damping", "viscosity"):
        assert getattr(
            chosen("rain.xml", '{name = "suited", amplitude = 0.05}'), name
        ) == pytest.approx(getattr(expected, name), rel=0.03)
    lower = chosen("rain.xml", '{name = "suited", amplitude = 0.02}')
    assert lower.density == pytest.approx(2.5 * expected.density, rel=0.03)
    with pytest.raises(
        SceneError, match=r"needs a size .* and a hit .*: nothing that moves can touch it"
    ):
        chosen("nothing.xml", '{name = "suited", amplitude = 0.02}')
    given = chosen("nothing.xml", '{name = "suited", size = 1.0, hit = 3.0}')
    assert given.density == Material.suited(1.0, 3.0).density


# a ball of 0.14 times the target's size, from a height of half the size
FALL = """<mujoco><option timestep="{dt}"/><worldbody>
<geom name="target" type="sphere" size="{half}"/>
    <body pos="0 0 {start}"><freejoint/><geom type="sphere" size="{radius}" density="500"/></body>
    </worldbody></mujoco>"""


def highest(
    model: mujoco.MjModel, material: Material, seconds: float, **options: object
) -> tuple[float, Ripples]:
    """Greatest height [m]; any warning is an error."""
    run = Run(model, "target", material=material, conserve_volume=True, **options)
    top = 0.0
    with warnings.catch_warnings(action="error"):
        while run.data.time < seconds - 1e-9:
            run.step()
            top = max(top, float(np.abs(run.ripples["target"].height).max()))
    return top, run.ripples


def test_a_heavy_box_rests_in_a_shallow_pit_with_any_stiffness() -> None:
    model = mujoco.MjModel.from_xml_string(BOX.format(mass=20))
    top, ripples = highest(model, Material(), 1.5, resolution=24)
    assert 1e-5 < top < 0.01
    assert np.abs(ripples["target"].velocity).max() < 0.01
    top, ripples = highest(model, Material(stiffness=0.0), 0.5, resolution=24)
    assert ripples["target"].material.stiffness == 0.0
    assert top < 0.25 * 0.25


@pytest.mark.parametrize("size", [5e-3, 0.02, 1.0, 30.0, 1e3])
def test_waves_suit_the_target_at_every_scale(size: float) -> None:
    dt = 0.002 * min(1.0, math.sqrt(size))
    xml = FALL.format(dt=dt, half=size / 2, start=1.08 * size, radius=0.07 * size)
    top, _ = highest(
        mujoco.MjModel.from_xml_string(xml), Material(), 0.45 * math.sqrt(size), resolution=24
    )
    assert 1e-4 * size < top < 0.1 * size


def test_density_is_the_bodys_mass_over_the_targets_area_where_nothing_can_touch_it() -> None:
    xml = """<mujoco><worldbody>
    <geom name="still" type="sphere" size="0.3" contype="2" conaffinity="2"/>
    <body pos="0 0 2"><freejoint/><geom name="free" type="sphere" size="0.5" mass="7"/></body>
    </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    chosen = Material()
    ripples = Ripples(model, {"still": chosen, "free": chosen}, resolution=8, backend="cpu")
    assert ripples["free"].material.density == pytest.approx(7 / (4 * np.pi * 0.25), rel=0.01)
    # the world has no mass: 1000 kg/m^3 times volume over area
    assert ripples["still"].material.density == pytest.approx(1000 * 0.3 / 3, rel=0.01)


def in_box(material: Material, mass: float = 20, **options: object) -> Material:
    """The material of a box under another one of a mass [kg]."""
    model = mujoco.MjModel.from_xml_string(BOX.format(mass=mass))
    for name, value in options.items():
        setattr(model.opt, name, value)
    return Ripples(model, {"target": material}, resolution=8, backend="cpu")["target"].material


def test_long_steps_have_less_stiffness() -> None:
    free, short, long = (in_box(Material(), timestep=dt) for dt in (1e-5, 1e-3, 1e-2))
    for material, dt in ((free, 1e-5), (short, 1e-3), (long, 1e-2)):
        assert math.sqrt(material.stiffness) * dt < 0.5001
    assert free.stiffness == short.stiffness > long.stiffness


# a ball that falls hard, from many times its size, on something heavy
FROM_HIGH = """<mujoco><option timestep="{dt}"/><worldbody><geom type="plane" size="9 9 1"/>
    <body pos="0 0 3"><freejoint/>
    <geom name="target" size="0.15" density="1000" solref="0.004 0.5"/></body>
    <body pos="0.05 0 0.6"><freejoint/><geom type="box" size="0.4 0.4 0.2" mass="90"/></body>
    </worldbody></mujoco>"""


def cheetah(dt: float | None = None) -> mujoco.MjModel:
    """Gymnasium's, with another time step if that is given."""
    assets = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
    model = mujoco.MjModel.from_xml_path(str(assets / "half_cheetah.xml"))
    model.opt.timestep = dt or model.opt.timestep
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
    model = make(dt)
    rng = np.random.default_rng(3)
    run = Run(model, *targets, material=Material(), resolution=16, conserve_volume=True)
    data = run.data
    ripples = run.ripples
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


def test_given_coefficients_stay_and_a_given_density_keeps_the_whole_material() -> None:
    kept = in_box(Material(speed=0.7, stiffness=3.0, viscosity=0.1))
    assert (kept.speed, kept.stiffness, kept.viscosity) == (0.7, 3.0, 0.1)
    assert kept.damping > 0 and kept.density != 1.0
    for whole in (Material(density=1.0), Material.jelly(), Material.suited(1.0, 2.0)):
        assert in_box(whole) is whole


def test_warning_about_a_surface_too_heavy_for_light_bodies() -> None:
    """As torsos of robots are where surfaces push back: they bear the whole robot."""
    link = (
        BOX.format(mass=3e4)
        .replace('"target"', '"target" mass="1"')
        .replace("<geom", "<body><freejoint/><geom", 1)
    )
    model = mujoco.MjModel.from_xml_string(link.replace('0.25"/>', '0.25"/></body>', 1))
    with pytest.warns(
        RippleWarning, match=r"'target' is to bear 3e\+04 kg.*Material.suited\(size=1, hit=\(1, m/s"
    ) as told:
        Ripples(model, {"target": Material()}, resolution=8, backend="cpu", two_way=True)
    assert told[0].filename == __file__
    with warnings.catch_warnings(action="error"):
        Ripples(model, {"target": Material.suited(1.0, (1.0, 2.0))}, resolution=8, backend="cpu")


# a robot of 200 kg that stands, or falls on its trunk, and a ball of 50 g
ROBOT = """<mujoco><option timestep="0.002"/><worldbody>
<geom type="plane" size="9 9 1" pos="0 0 -0.4"/>
    <body><freejoint/>
    <geom name="target" type="capsule" size="0.15 0.25" zaxis="1 0 0" mass="199"/>{legs}</body>
    <body pos="{x} 0 0.35"><freejoint/><geom name="ball" size="0.04" mass="0.05"/></body>
    </worldbody></mujoco>"""
LEGS = '<geom type="box" size="0.2 0.2 0.1" pos="0 0 -0.3" mass="1"/>'


def test_a_chosen_material_shows_a_light_ball_on_a_heavy_robot_and_bears_the_robot() -> None:
    """Their impulses differ by a factor of thousands."""
    peaks = []
    given = []
    said = []
    for legs, x in ((LEGS, 0.1), ("", 5.0)):
        model = mujoco.MjModel.from_xml_string(ROBOT.format(legs=legs, x=x))
        run = Run(model, "target", material=Material(), resolution=24, conserve_volume=True)
        waves = run.ripples["target"]
        impulse = 0.0
        peak = 0.0
        with warnings.catch_warnings(record=True, action="always") as caught:
            while run.data.time < 0.5:
                impulse += sum(hit.impulse for hit in run.step())
                peak = max(peak, float(np.abs(waves.height).max()))
        peaks.append(peak)
        given.append(impulse)
        said.append([str(each.message) for each in caught])
    size = 0.8
    radius = 0.15
    assert given[0] < 0.3 < 300 < given[1], "impulses are told as they are"
    assert 0.004 * size < peaks[0] < 2 * peaks[1] and peaks[1] < 0.25 * radius
    assert said[0] == []
    [message] = said[1]
    assert (
        "geom 'target' shows hits of the lightest body" in message
        and "give the material a density" in message
    )


def test_a_density_ends_the_easing() -> None:
    model = mujoco.MjModel.from_xml_string(ROBOT.format(legs="", x=5.0))
    heights = []
    for changed in (False, True):
        run = Run(model, "target", material=Material(), resolution=16, conserve_volume=True)
        run.ripples.allow_any_height("target")
        if changed:
            run.ripples.change_material(
                "target", density=float(run.ripples["target"].material.density)
            )
        with warnings.catch_warnings(action="ignore", category=RippleWarning):
            run.until(0.4)
        heights.append(float(np.abs(run.ripples["target"].height).max()))
    assert heights[1] > 100 * heights[0]


@pytest.mark.parametrize(
    ("is_eased", "texels", "is_told"), [(False, 1, True), (True, 1, False), (True, 500, True)]
)
def test_eased_targets_are_not_reported_for_high_waves_on_a_hundredth_of_the_surface(
    is_eased: bool, texels: int, is_told: bool
) -> None:
    """A ring that runs into a thin rim is limited in pictures, and a density would hide it."""
    bodies = FALLING.format(0.05, 0.2) + FALLING.format(0.2, 90.0).replace("1.6", "3")
    model = mujoco.MjModel.from_xml_string(RAIN.format(bodies))
    material = Material(speed=0.01, stiffness=1.0)
    if not is_eased:
        material = dataclasses.replace(material, density=1.0)
    ripples = Ripples(model, {"target": material}, resolution=16, backend="cpu")
    waves = ripples["target"]
    height = np.zeros(waves.height.size)
    height[:texels] = 0.2  # of a radius of 0.5 m
    waves.height = height.reshape(waves.height.shape)
    with warnings.catch_warnings(record=True, action="always") as caught:
        data = mujoco.MjData(model)
        for _ in range(20):
            ripples.mj_step(data)
    assert any("too high" in str(each.message) for each in caught) == is_told


def test_a_heavier_body_is_met_by_a_heavier_surface() -> None:
    light, middle, heavy = (in_box(Material(), mass) for mass in (1e-6, 20.0, 200.0))
    for material in (light, middle, heavy):
        assert material.stiffness == pytest.approx((16 * 4.43 / 1.0) ** 2, rel=0.01)
    assert light.density < middle.density < heavy.density
    assert heavy.density == pytest.approx(10 * middle.density)
    # without gravity it is there, too: the hit of a fall of a size a second
    assert (
        middle.density / 100 < in_box(Material(), gravity=(0.0, 0.0, 0.0)).density < middle.density
    )


EGG = """<mujoco><option timestep="{dt}"/><worldbody>
<geom name="egg" type="ellipsoid" size="{a} {a} {b}"/>
    <body pos="0 0 {start}"><freejoint/><geom type="sphere" size="{ball}"/></body></worldbody>
    </mujoco>"""


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
    slow, fast = (Material(speed=speed, density=1.0) for speed in (0.04, 1.0))
    assert [chosen(each, 0.04)["egg"].atlas.resolution for each in (slow, fast)] == [96, 32]
    assert 32 < chosen(fast, 0.04, dt=0.0004)["egg"].atlas.resolution < 96


def test_a_small_body_gets_texels_that_resolve_its_footprint() -> None:
    waves = chosen(Material(speed=0.5, density=1.0), ball=0.03)["egg"]
    assert waves.atlas.resolution > 96
    assert waves.atlas.areas.mean() ** 0.5 < 0.5 * 0.03 / 3.5


def test_only_meshes_that_are_no_spheres_in_shape_are_intricate() -> None:
    V, F = icosphere(5)
    assert not _is_intricate(Mesh.from_arrays(V, F))
    assert _is_intricate(Mesh.from_arrays(V, F[1:])), "a hole"
    assert _is_intricate(
        Mesh.from_arrays(np.concatenate([V, V + 3.0]), np.concatenate([F, F + len(V)]))
    ), "two parts"
    V, F = icosphere(3)
    assert not _is_intricate(Mesh.from_arrays(V, F[1:])), "few triangles"


def test_a_given_resolution_is_used() -> None:
    model = mujoco.MjModel.from_xml_string(EGG.format(dt=0.002, a=0.3, b=0.5, start=1, ball=0.1))
    for given in (24, {"egg": 24}):
        assert (
            Ripples(model, {"egg": Material()}, resolution=given, backend="cpu")[
                "egg"
            ].atlas.resolution
            == 24
        )
    assert (
        Ripples(model, {"egg": Target(resolution=None)}, backend="cpu")["egg"].atlas.resolution
        >= 32
    )
    assert Simulation(load_scene("sphere"), resolution=16).ripples["sphere"].atlas.resolution == 16


@pytest.mark.parametrize("share", [0.02, 0.1, 0.4])
def test_dents_stay_small_and_rings_are_seen(share: float) -> None:
    """A ball of a share of a sphere's size falls on it from the height of its size."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><geom name="target" type="sphere" size="0.5"/>
        <body pos="0.01 0.02 {1.5 + share / 2}"><freejoint/><geom size="{share / 2}"/></body>
        </worldbody></mujoco>"""
    )
    run = Run(model, "target", material=Material(), resolution=32, conserve_volume=True)
    waves = run.ripples["target"]
    dent = 0.0
    ring = 0.0
    places = waves.atlas.positions
    around = (np.hypot(places[..., 0], places[..., 1]) > share / 2 + 0.05) & (places[..., 2] > 0)
    while run.data.time < 0.9:
        run.step()
        dent = max(dent, -float(waves.height.min()))
        ring = max(ring, float(np.abs(waves.height[around]).max()))
    assert 0.01 < dent / 0.5 < 0.25
    assert 0.005 < ring < 0.02


BALL = """<mujoco><option timestep="0.002"/><worldbody>
    <geom name="target" type="sphere" size="0.5"/>
    <body pos="0 0 0.56"><freejoint/><geom type="sphere" size="0.05" mass="0.36"/></body>
    </worldbody></mujoco>"""

ON_ANIMAL = f"""<mujoco><option timestep="0.002" sdf_initpoints="8"/><asset>{limbed_asset()}</asset>
<worldbody>
    <geom name="target" type="sdf" mesh="limbed"/>
    <body pos="0.03 0 0.55"><freejoint/><geom type="sphere" size="0.05" mass="1.7"/></body>
    </worldbody></mujoco>"""

WEAK = Material(speed=0.6, damping=1.0, stiffness=0.0, density=1.0)


def warned(
    xml: str, material: Material, seconds: float = 0.5, backend: str = "cpu"
) -> tuple[list[str], Ripples]:
    """Messages of a ball that falls on the target at 4.5 m/s, and the ripples afterwards."""
    model = mujoco.MjModel.from_xml_string(xml)
    run = Run(
        model, "target", material=material, resolution=32, conserve_volume=True, backend=backend
    )
    run.data.qvel[2] = -4.5
    with warnings.catch_warnings(record=True, action="always") as caught:
        run.until(seconds)
    assert all(issubclass(each.category, RippleWarning) for each in caught)
    return [str(each.message) for each in caught], run.ripples


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
def test_a_hard_hit_is_reported_once_and_the_named_material_would_do(
    xml: str, material: Material
) -> None:
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
@pytest.mark.parametrize(
    "material", [Material(density=1.0), Material(speed=0.3, damping=1, stiffness=300, density=5)]
)
def test_material_advised_after_one_step_of_a_foot_suits_other_steps_too(
    material: Material,
) -> None:
    model = cheetah()

    def messages(material: Material, seed: int) -> list[str]:
        data = mujoco.MjData(model)
        rng = np.random.default_rng(seed)
        with warnings.catch_warnings(record=True, action="always") as caught:
            ripples = Ripples(model, {"ffoot": material}, resolution=16, backend="cpu")
            for _ in range(30):
                data.ctrl[:] = rng.uniform(-1, 1, model.nu)
                ripples.mj_step(data, 5)
            ripples.reset()
        return [str(each.message) for each in caught if "the waves on" in str(each.message)]

    [message] = messages(material, seed=0)
    heavier = advised(message)
    assert all(messages(heavier, seed) == [] for seed in range(3))


def test_advice_names_all_coefficients_where_the_model_chose_the_material() -> None:
    data, ripples = still_ripples(Material())
    ripples.poke("target", [0, 0, 0.5], 200.0, 0.1)
    with pytest.warns(RippleWarning) as caught:
        ripples.mj_step(data, nstep=80)
    heavier = advised(str(caught[0].message))
    chosen = ripples["target"].material
    for name in ("speed", "damping", "stiffness"):
        assert getattr(heavier, name) == pytest.approx(getattr(chosen, name), rel=1e-3)
    data, ripples = still_ripples(heavier)
    ripples.poke("target", [0, 0, 0.5], 200.0, 0.1)
    with warnings.catch_warnings(action="error"):
        ripples.mj_step(data, nstep=80)


@pytest.mark.parametrize(
    ("before", "after", "end"),
    [(18, 1, "goes on"), (2, 1, "new material"), (0, 16, "reset"), (1, 0, "reset")],
)
def test_a_crest_of_any_step_is_reported(before: int, after: int, end: str) -> None:
    """With an old material too, and at a reset, though nobody has looked yet."""
    data, ripples = still_ripples()
    ripples.mj_step(data, nstep=before)
    ripples["target"].height = 0.4
    ripples.mj_step(data, nstep=after)
    if end == "new material":
        ripples.change_material("target", damping=2.0)
    with pytest.warns(RippleWarning, match=r"0.4 m at .* radius is 0.5 m"):
        if end == "reset":
            ripples.reset()
        else:
            ripples["target"].height = 0.0
            ripples.mj_step(data, nstep=40)


@pytest.mark.parametrize(("density", "is_too_high"), [(8.0, False), (3.0, True)])
def test_only_the_height_of_the_ring_is_judged_and_not_the_dent_under_the_body(
    density: float, is_too_high: bool
) -> None:
    """Both dents are deeper than a quarter of the radius, 0.125 m; one ring is higher than that."""
    material = Material(speed=4.4, damping=1.5, stiffness=5000.0, density=density)
    messages, _ = warned(BALL, material)
    assert ["too high" in message for message in messages] == [True] * is_too_high


def test_amplitude_is_checked_on_the_gl_backend_too(opengl: None) -> None:
    [message], _ = warned(BALL, WEAK, seconds=1.0, backend="gl")
    assert "geom 'target' are too" in message


def still_ripples(material: Material = WEAK) -> tuple[mujoco.MjData, Ripples]:
    model = mujoco.MjModel.from_xml_string(BALL)
    model.opt.gravity[:] = 0
    return mujoco.MjData(model), Ripples(model, {"target": material}, resolution=32, backend="cpu")


def test_steep_waves_are_reported_although_they_are_low() -> None:
    data, ripples = still_ripples(Material(speed=1e-3, damping=0.0, stiffness=0.0, density=1.0))
    z = ripples["target"].atlas.positions[..., 2]
    ripples["target"].height = (0.05 * np.sin(40 * z)).astype(np.float32)
    with pytest.warns(RippleWarning, match=r"too steep: a slope of 1.* on "):
        ripples.mj_step(data, nstep=80)


def test_allow_any_height_turns_the_warning_off() -> None:
    data, ripples = still_ripples()
    ripples.allow_any_height("target")
    ripples["target"].height = 0.4
    with warnings.catch_warnings(action="error"):
        ripples.mj_step(data, nstep=80)


def test_advice_for_a_map_names_a_factor() -> None:
    data, ripples = still_ripples()
    ripples.change_material("target", density=np.full(ripples["target"].atlas.areas.shape, 2.0))
    ripples["target"].height = 0.4
    with pytest.warns(RippleWarning) as caught:
        ripples.mj_step(data, nstep=80)
    [message] = [str(each.message) for each in caught]
    call = re.search(
        r"would do: (ripples\.change_material\('target', density=[\d.]+ \* .*)$", message
    )
    assert call is not None, message
    before = ripples["target"].material.density
    exec(call[1], {"ripples": ripples})
    assert (ripples["target"].material.density > 4 * before).all()
