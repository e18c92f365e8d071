"""Bodies at rest: the surface is still and bears their weight; no impulse is lost."""

import functools

import mujoco
import numpy as np
import pytest
from hits import Run
from mujoco_models import limbed_asset
from unfiltered import WithAndWithout, rms

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.coupling import NO_FORCES, RestFilter, TexelForces
from ripple_sim.solver import Load, sphere_atlas
from ripple_sim.solver.waves.footprint import footprint
from ripple_sim.testing import assert_wave_at

GRAVITY = 9.81
# of the softest material that still becomes still within a few seconds
MATERIAL = Material(speed=0.6, damping=5.0, stiffness=1000.0, viscosity=3e-4, density=100.0)

TARGETS = {
    "sphere": ('<geom name="target" type="sphere" size="2" pos="0 0 -2"/>', 0.0),
    "box": ('<geom name="target" type="box" size="0.5 0.5 0.1" pos="0 0 -0.1"/>', 0.0),
    "animal": ('<geom name="target" type="sdf" mesh="limbed" pos="0.03 0 -0.446"/>', 0.01),
    "flex": ('<geom name="target" type="mesh" mesh="limbed" pos="0.03 0 -0.446"/>', 0.01),
}

BODIES = {
    "ball": 'type="sphere" size="0.05"',
    "box": 'type="box" size="0.06 0.05 0.04"',
    "capsule": 'type="capsule" size="0.03 0.05" euler="90 0 0"',
}


def model_of(target: str, body: str, solref: str) -> mujoco.MjModel:
    geom, top = TARGETS[target]
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><option timestep="0.002" sdf_initpoints="40"/>
        <default><geom solref="{solref}" friction="1 0.05 0.05" condim="6"/></default>
        <asset>{limbed_asset()}</asset>
        <worldbody>{geom}<body name="body" pos="0 0 {top + 0.2}"><freejoint/>
        <geom {BODIES[body]} mass="0.5"/></body>
        </worldbody></mujoco>"""
    )
    if target == "flex":
        make_collidable(spec, "target", "flex")
    return spec.compile()


pytestmark = pytest.mark.filterwarnings(
    "ignore:geom 'target' collides through a flex", "ignore:the waves on geom"
)

CALM = "0.02 1"
CHATTERING = "0.01 0.2"


# the latter never comes quite to rest: contacts of flat bodies break and close at every other step
@pytest.mark.parametrize(
    "pair", ["sphere ball", "box box", "box capsule", "animal box", "flex box"]
)
def test_surface_under_a_body_at_rest_becomes_still_in_its_dimple(pair: str) -> None:
    target, body = pair.split()
    model = model_of(target, body, CALM if target == "sphere" else CHATTERING)
    run = Run(model, "target", material=MATERIAL, resolution=24)
    history = []
    data = run.data
    waves = run.ripples["target"]
    while data.time < 4:
        run.step()
        history.append(rms(waves))
    # a body that still rocks on a chattering contact disturbs the surface now and then
    assert np.median(history[-250:]) < 0.001 * max(history[:250])
    # the springs under the whole surface bear the weight
    support = -(waves.operator.mass * MATERIAL.stiffness * waves.height.astype(np.float64)).sum()
    # ... of which the slope of the animal's back takes a little along the surface
    assert support == pytest.approx(
        0.5 * GRAVITY, rel=0.02 if target in ("animal", "flex") else 0.005
    )
    assert_wave_at(waves, data.body("body").xpos, within=0.12)


def test_box_that_lies_flat_loads_the_surface_under_its_middle_too() -> None:
    material = Material(speed=0.1, damping=20.0, stiffness=1000.0, density=100.0)
    run = Run(
        model_of("box", "box", "0.02 1"),
        "target",
        material=material,
        resolution=64,
        conserve_volume=True,
    )
    waves = run.until(1.5).ripples["target"]
    place = waves.atlas.positions.reshape(-1, 3)
    height = waves.height.reshape(-1)
    above = place[:, 2] > 0.099
    middle = above & (np.hypot(place[:, 0], place[:, 1]) < 0.015)
    corner = (
        above
        & (np.abs(np.abs(place[:, 0]) - 0.06) < 0.012)
        & (np.abs(np.abs(place[:, 1]) - 0.05) < 0.012)
    )
    away = above & (np.hypot(place[:, 0], place[:, 1]) > 0.2)
    assert height[middle].max() < 0
    assert height[middle].mean() < height[corner].mean() < 0
    assert np.abs(height[away]).max() < 0.02 * np.abs(height[middle]).max()


@pytest.mark.parametrize(("target", "dt"), [("animal", 0.004), ("box", 0.002)])
def test_surface_under_a_stack_and_its_neighbours_becomes_still(target: str, dt: float) -> None:
    _, top = TARGETS[target]
    places = [("box", 0.0, 0.1), ("box", 0.0, 0.2)]
    places += [("capsule", -0.3, 0.05), ("ball", 0.3, 0.06)] * (target == "box")
    body = '<body pos="{} 0 {}"><freejoint/><geom {} mass="0.5"/></body>'
    bodies = "".join(body.format(x, top + z, BODIES[kind]) for kind, x, z in places)
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{dt}" sdf_initpoints="10"/><default>
        <geom friction="1 0.05 0.05" condim="6"/>
        </default><asset>{limbed_asset()}</asset><worldbody>{TARGETS[target][0]}{bodies}</worldbody>
        </mujoco>"""
    )
    run = Run(model, "target", material=MATERIAL, resolution=16)
    history = []
    while run.data.time < 4:
        run.step()
        history.append(rms(run.ripples["target"]))
    assert len(run.hits[-1]) == len(places) - 1
    assert max(history[-50:]) < 0.001 * max(history)


def hammered(target: str, off: float) -> mujoco.MjModel:
    """A block that rests on a target, and a hammer held above it, so far off its middle [m]."""
    geom, top = TARGETS[target]
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002" sdf_initpoints="10"/>
        <default><geom friction="1 0.05 0.05" condim="6"/></default><asset>{limbed_asset()}</asset>
        <worldbody>{geom}
        <body name="body" pos="0 0 {top + 0.041}"><freejoint/>
        <geom {BODIES["box"]} mass="0.5" conaffinity="3"/></body>
        <body name="hammer" pos="{off} 0 {top + 0.5}" gravcomp="1">
        <joint name="hammer" type="slide" axis="0 0 1"/>
        <geom size="0.03" mass="1" contype="2" conaffinity="2"/></body></worldbody></mujoco>"""
    )


@pytest.mark.parametrize("rest", [0.05, 2.0])
@pytest.mark.parametrize(
    ("target", "off", "speed"), [("box", 0.03, 3.0), ("box", 0.0, 0.2), ("animal", 0.03, 3.0)]
)
def test_a_hit_makes_the_same_wave_after_any_rest(
    target: str, off: float, speed: float, rest: float
) -> None:
    model = hammered(target, off)
    data = mujoco.MjData(model)
    waves = WithAndWithout(model, MATERIAL, 12)
    hammer = model.joint("hammer")
    struck = False
    while data.time < rest + 0.2:
        if data.time >= rest and not struck:
            above = data.body("body").xpos[2] + 0.04 + 0.03 + 0.002
            data.qpos[hammer.qposadr] = above - model.body("hammer").pos[2]
            data.qvel[hammer.dofadr] = -speed
            struck = True
        mujoco.mj_step(model, data)
        waves.step(data)
    filtered, unfiltered = np.array(waves.history)[round(rest / 0.002) :].max(axis=0)
    assert filtered == pytest.approx(unfiltered, rel=0.03)


@pytest.mark.parametrize(("frequency", "dt"), [(0.5, 0.004), (5.0, 0.002), (50.0, 0.004)])
def test_a_rod_that_stays_in_contact_drives_waves_for_ever(frequency: float, dt: float) -> None:
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{dt}"/><worldbody>{TARGETS["sphere"][0]}
        <body pos="0 0 0.06"><joint name="rod" type="slide" axis="0 0 1"/>
        <geom type="capsule" size="0.03 0.03"
        mass="1"/></body></worldbody><actuator><motor joint="rod"/></actuator></mujoco>"""
    )
    data = mujoco.MjData(model)
    waves = WithAndWithout(model, MATERIAL, 8)
    while data.time < 6:
        data.ctrl[0] = 0.8 * GRAVITY * np.sin(2 * np.pi * frequency * data.time)
        mujoco.mj_step(model, data)
        waves.step(data)
    assert np.shape(data.contact.geom) == (1, 2)
    late = np.array(waves.history)[-round(2 / dt) :]
    np.testing.assert_allclose(*np.sqrt((late**2).mean(axis=0)), rtol=0.01)
    # the wave of the height at the time, not of its amount alone
    np.testing.assert_allclose(
        waves.filtered.height, waves.unfiltered.height, atol=0.01 * late.max()
    )


def test_a_body_that_rolls_slowly_leaves_a_calm_surface() -> None:
    """The footprint changes at every third of a texel: noise without the filter."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.002"/><worldbody>
        <geom name="target" type="box" size="0.4 0.2 0.1"/>
        <body pos="-0.1 0 0.15"><freejoint/><geom size="0.05" mass="0.5"/></body></worldbody>
        </mujoco>"""
    )
    data = mujoco.MjData(model)
    waves = WithAndWithout(model, MATERIAL, 24)
    data.qvel[[0, 4]] = 0.05, 1.0
    while data.time < 3:
        mujoco.mj_step(model, data)
        waves.step(data)
    filtered, unfiltered = np.array(waves.history)[-500:].max(axis=0)
    assert filtered < 0.5 * unfiltered
    # it is where the body is
    deepest = waves.filtered.atlas.positions.reshape(-1, 3)[waves.filtered.height.argmin()]
    assert np.linalg.norm(deepest[:2] - data.qpos[:2]) < 0.05


# a slab without symmetries: round-off does not choose its layout
UNEVEN = (
    "-.5 -.41 -.1 .52 -.4 -.1 .5 .43 -.1 -.48 .4 -.1 -.4 -.31 .1 .42 -.3 .1 .4 .33 .1 -.43 .3 .1"
)


@functools.cache
def dropped(scale: float) -> np.ndarray:
    """Heights over the scale under a chattering box and ball, at lengths that scale."""
    s = scale
    t = np.sqrt(scale)
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{0.002 * t}" tolerance="1e-14" iterations="200"/>
        <default><geom solref="{0.01 * t} 0.2" solimp="0.9 0.95 {0.001 * s} 0.5 2"/></default>
        <asset><mesh name="uneven" vertex="{UNEVEN}" scale="{s} {s} {s}"/></asset><worldbody>
        <geom name="target" type="mesh" mesh="uneven"/>
        <body pos="{0.05 * s} {0.02 * s} {0.3 * s}"><freejoint/>
        <geom type="box" size="{0.06 * s} {0.05 * s} {0.04 * s}" mass="{0.5 * s**3}"/></body>
        <body pos="{-0.25 * s} {0.1 * s} {0.25 * s}"><freejoint/>
        <geom size="{0.06 * s}" mass="{0.3 * s**3}"/></body>
        </worldbody></mujoco>"""
    )
    material = Material(t, 1 / t, 200 / s, density=100 * s, viscosity=1e-3 * s * t)
    # patches of so few texels lie elsewhere after another round-off
    ripples = Ripples(model, {"target": material}, resolution=16, layout="cube", backend="cpu")
    data = mujoco.MjData(model)
    heights = []
    for _ in range(50):
        ripples.mj_step(data, nstep=10)
        heights.append(ripples["target"].height / s)
    return np.array(heights)


@pytest.mark.parametrize(("scale", "frames"), [(1 / 64, 50), (64.0, 50), (0.01, 20), (100.0, 20)])
def test_scaled_scenes_have_scaled_waves(scale: float, frames: int) -> None:
    """Powers of 4 have the same round-off; that of other factors grows while bodies chatter."""
    heights = dropped(1.0)[:frames]
    np.testing.assert_allclose(dropped(scale)[:frames], heights, atol=1e-3 * np.abs(heights).max())


class LoadedSphere:
    """A sphere of 1 m under the load of one geom, geom 0."""

    def __init__(self, resolution: int, radius: float, dt: float) -> None:
        self.atlas = sphere_atlas(1.0, resolution)
        self.radius = radius
        self.dt = dt
        self.filter = RestFilter(1, self.atlas.areas.size)

    def at(self, point: np.ndarray, force: float) -> Load:
        where = footprint(self.atlas, point, self.radius)
        forces = force * where.weights * self.atlas.areas.reshape(-1)[where.texels]
        rows = np.array([0, len(forces)])
        geoms = np.zeros(1, np.int64)
        radii = np.array([self.radius / 2])
        return self.filter(
            TexelForces(geoms, point[None], radii, rows, where.texels, forces), self.dt
        )


def given_over_time(forces: np.ndarray, dt: float) -> np.ndarray:
    """Force that the surface receives in each step, while a geom touches and for a second after."""
    sphere = LoadedSphere(16, 0.3, dt)
    given = []
    for force in np.concatenate([forces, np.zeros(round(1.0 / dt))]):
        out = (
            sphere.at(np.array([0.0, 0.0, 1.0]), force)
            if force > 0
            else sphere.filter(NO_FORCES, dt)
        )
        given.append(out.forces.sum())
    assert not sphere.filter.active.any()
    return np.array(given)


@pytest.mark.parametrize("kind", ["steady", "driven", "noise", "hit"])
def test_the_force_of_unbroken_contact_passes_unchanged(kind: str) -> None:
    dt = 0.002
    steps = 2000
    force = np.full(steps, 3.0)
    if kind == "driven":
        force += 2.9 * np.sin(2 * np.pi * 5.0 * dt * np.arange(steps))
    elif kind == "noise":
        force = np.random.default_rng(0).exponential(3.0, steps)
    elif kind == "hit":
        force[1500:1510] += 300.0
    given = given_over_time(force, dt)
    np.testing.assert_allclose(given[:steps], force, rtol=1e-9)
    assert np.abs(given[steps:]).max() < 1e-9


# openings of a step, after two to five of contact
CHATTER = {"each other step": (0, 6), "sixth": (1.5, 4.4, 4.2, 3.5, 2.9, 0), "third": (0, 6, 4)}


@pytest.mark.parametrize(
    ("kind", "dt"),
    [
        ("each other step", 0.004),
        ("third", 0.004),
        *((kind, dt) for kind in CHATTER for dt in (0.0005, 0.002)),
    ],
)
def test_chatter_is_averaged_without_loss_of_impulse(kind: str, dt: float) -> None:
    steps = round(6.0 / dt)
    force = np.resize(CHATTER[kind], steps).astype(np.float64)
    given = given_over_time(force, dt)
    assert given.sum() == pytest.approx(force.sum(), rel=1e-9)
    late = given[steps - 500 : steps]
    assert late.std() < 0.2 * force.std()
    assert late.mean() == pytest.approx(force.mean(), rel=0.02)
    assert np.abs(given[steps:]).max() < force.max()


def test_a_hit_on_a_chattering_geom_passes() -> None:
    dt = 0.002
    steps = 2500
    force = np.resize([0.0, 6.0, 4.0], steps)
    hit = np.zeros(steps)
    hit[2000:2006] = [100, 300, 500, 500, 300, 100]
    given = given_over_time(force + hit, dt)
    assert given.sum() == pytest.approx((force + hit).sum(), rel=1e-9)
    passed = given - given_over_time(force, dt)
    assert passed[2000:2007].sum() == pytest.approx(hit.sum(), rel=0.05)
    assert np.abs(passed[2020:2500]).max() < 0.01 * hit.max()


def test_the_place_of_a_geom_at_rest_is_averaged() -> None:
    """Its weight jumps between two points, which a hit does not wait for."""
    sphere = LoadedSphere(32, 0.2, 0.002)
    rng = np.random.default_rng(1)
    given = []
    for step in range(2000):
        angle = 0.04 * rng.integers(2)
        load = sphere.at(
            np.array([np.sin(angle), 0.0, np.cos(angle)]), 3.0 if step < 1990 else 300.0
        )
        given.append(np.bincount(load.texels, load.forces, sphere.atlas.areas.size))
    given = np.array(given)
    change = np.abs(np.diff(given, axis=0)).sum(axis=1)
    assert change[1500:1988].max() < 0.01 * change[:30].max()
    assert change[1990:].max() > 50 * change[:30].max()


def forces_of(geoms: list[int], texels: list[np.ndarray], forces: list[np.ndarray]) -> TexelForces:
    """Geoms that load eight texels each, and stay in their places."""
    begins = 8 * np.arange(len(geoms) + 1)
    middles = np.zeros((len(geoms), 3))
    at = np.array(texels, np.int64).reshape(-1)
    loads = np.array(forces, np.float64).reshape(-1)
    return TexelForces(
        np.array(geoms, np.int64), middles, np.full(len(geoms), 0.05), begins, at, loads
    )


def test_each_geom_is_filtered_independently() -> None:
    """Three geoms that come and go, together and alone."""
    size = 96
    dt = 0.002
    rng = np.random.default_rng(3)
    alone = [RestFilter(4, size) for _ in range(4)]
    every = RestFilter(4, size)
    for step in range(400):
        present = [g for g in range(1, 4) if rng.random() < (0.9, 0.5, 0.02)[g - 1] and step < 200]
        texels = [rng.permutation(8) + 10 * g for g in present]
        forces = [rng.exponential(1.0, 8) for _ in present]
        load = every(forces_of(present, texels, forces), dt)
        together = np.bincount(load.texels, load.forces, size)
        apart = np.zeros(size)
        for g in range(1, 4):
            mine = slice(present.index(g), present.index(g) + 1) if g in present else slice(0, 0)
            own = alone[g](forces_of(present[mine], texels[mine], forces[mine]), dt)
            apart += np.bincount(own.texels, own.forces, size)
        np.testing.assert_array_equal(together, apart)
    assert not every.active.any()
    assert not len(every(NO_FORCES, dt).texels)
