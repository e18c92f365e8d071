"""A target whose material changes while its waves run."""

import copy
import pickle
from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from hits import Run
from mujoco_models import BALL, forwarded, model_of

from ripple_sim import Material, RippleError, Ripples, RippleWarning


def test_material_may_change_under_a_body_at_rest() -> None:
    """What the surface has not got yet of a long contact is not lost."""
    momenta = []
    for change in (False, True):
        data, ripples = ball_on_sphere(Material(density=50.0))
        for step in range(800):
            ripples.mj_step(data)
            if change and step == 300:
                ripples.change_material("target", speed=2.0)
        momenta.append(ripples["target"].momentum())
    assert momenta[1] == pytest.approx(momenta[0], rel=1e-4)
    with pytest.raises(RippleError, match="no coefficient 'sped'; coefficients are speed, damping"):
        ripples.change_material("target", sped=1.0)


@pytest.mark.parametrize("place", ["poke", "rigid"])
def test_places_are_in_the_frame_of_the_body_as_in_the_model(place: str) -> None:
    """MuJoCo puts a mesh's frame at its middle, along its axes of inertia: nobody knows it."""
    target = '<geom name="target" type="ellipsoid" size="0.3 0.2 0.2" pos="1 0 0" euler="0 90 0"/>'
    model = model_of(
        f'<body pos="3 0 0" euler="0 0 90">{target}<site name="end" pos="1 0 -0.3"/></body>'
    )
    run = Run(model, "target", resolution=16, conserve_volume=True)
    mujoco.mj_forward(model, data := run.data)
    ripples = run.ripples
    end = model.site("end").pos
    if place == "poke":
        with pytest.warns(
            RippleWarning,
            match=r"a poke of 'target' is 2\.7 m off its surface \(450% of its size\)",
        ):
            ripples.poke("target", [1.0, 0.0, -3.0], 0.0)
        ripples.poke("target", end, 0.01, 0.1)
        ripples["target"].step(1e-3)
        chosen = ripples["target"].height < 0.5 * ripples["target"].height.min()
    else:
        ripples.make_rigid("target", end, 0.1)
        chosen = ~ripples["target"].operator.movable
    atlas = ripples["target"].atlas
    world = ripples["target"].to_world(atlas.positions[chosen], data)
    assert 2 < len(world) < 60
    assert np.linalg.norm(world - data.site("end").xpos, axis=1).max() < 0.12


def ball_on_sphere(material: Material) -> tuple[mujoco.MjData, Ripples]:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 0.6"))
    run = Run(model, "target", material=material, resolution=16)
    return run.data, run.ripples


@pytest.mark.parametrize(
    "change",
    [
        lambda ripples: ripples.change_material("target", damping=1.0),
        lambda ripples: ripples.change_material("target", yield_height=np.inf),
        lambda ripples: ripples.hold("target", ripples["target"].atlas.positions[..., 2] < 0),
        lambda ripples: ripples.make_rigid("target", [0, 0, 0.5], 0.2),
        lambda ripples: ripples.change_operator("paper"),
    ],
    ids=["damping", "yield height", "hold", "make rigid", "operator"],
)
def test_a_dent_outlives_a_change_of_the_material(change: Callable[[Ripples], None]) -> None:
    _, ripples = ball_on_sphere(Material.dent(yield_height=1e-3, stiffness=2000.0, damping=20.0))
    ripples["target"].add_impulse([0, 0, 0.5], 0.3, 0.2)
    ripples["target"].step(2.0)
    dent = ripples["target"].dent
    assert np.abs(dent).max() > 2e-3
    change(ripples)
    waves = ripples["target"]
    assert (waves.dent == dent).all()
    waves.step(1.0)
    assert (waves.dent == dent).all()
    assert np.abs(waves.height - dent).max() < 1e-4


def test_texels_without_waves_do_not_drift_under_a_body_at_rest() -> None:
    """The waves got their velocity and a share of the coming forces before they became rigid."""
    data, ripples = ball_on_sphere(Material(density=50.0, stiffness=50.0, damping=5.0))
    ripples.mj_step(data, nstep=1500)
    z = ripples["target"].atlas.positions[..., 2]
    ripples.change_material("target", speed=np.where(z > 0.4, 0.0, 1.0), stiffness=0.0, damping=0.0)
    before = ripples["target"].height
    ripples.mj_step(data, nstep=1000)
    rigid = ~ripples["target"].operator.movable
    assert rigid[z > 0.4].all()
    assert (ripples["target"].height == before)[rigid].all()


@pytest.mark.parametrize(
    "copied", [copy.deepcopy, lambda ripples: pickle.loads(pickle.dumps(ripples))]
)
def test_copied_ripples_continue_like_the_original(copied: Callable[[Ripples], Ripples]) -> None:
    model = model_of('<geom name="target" type="box" size="0.5 0.5 0.5"/>' + BALL.format("0 0 0.6"))
    run = Run(model, "target", resolution=16, conserve_volume=True).until(0.15)
    twin = copied(run.ripples)
    twin_data = copy.copy(run.data)
    twin.mj_step(twin_data, nstep=50)
    height = run.until(0.2).ripples["target"].height
    assert np.abs(height).max() > 0
    assert (twin["target"].height == height).all()


def test_the_rim_of_the_surfaces_is_handed_on_and_outlives_changes() -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>')
    ripples = Ripples(
        model, {"target": Material(density=50.0)}, resolution=8, backend="cpu", rim="fixed"
    )
    assert ripples["target"].operator.topology.fixed_rim
    ripples.change_material("target", speed=2.0)
    assert ripples["target"].operator.topology.fixed_rim
    with pytest.raises(RippleError, match=r"rim must be one of .*, got 'bent'"):
        Ripples(model, {"target": Material()}, resolution=8, backend="cpu", rim="bent")


def test_a_sensor_on_a_site_continues_when_the_material_changes() -> None:
    model = model_of(
        '<body name="a" pos="3 0 0" euler="0 0 90"><geom name="target" type="ellipsoid" size="0.3 '
        '0.2 0.2" '
        'pos="1 0 0" euler="0 90 0"/><body euler="0 0 20"><site name="end" pos="0.94 -0.34 '
        '-0.3"/></body></body>'
        '<body name="b"><freejoint/><geom size="0.1"/><site name="off"/></body>'
    )
    data = forwarded(model)
    ripples = Run(model, "target", resolution=16, conserve_volume=True).ripples
    sensor = ripples["target"].sensor("end", "velocity", 1000.0)
    world = ripples["target"].to_world(sensor.points, data)
    assert np.linalg.norm(world - data.site("end").xpos) < 0.02
    ripples.poke("target", [1, 0, -0.3], 0.01, 0.1)
    ripples["target"].step(1.0)
    ripples.change_material("target", speed=0.3)
    ripples["target"].step(1.0)
    assert sensor.times[-1] > 1.1 and np.abs(sensor.samples).max() > 0
    with pytest.raises(RippleError, match="no site 'tip'; its sites are end, off"):
        ripples["target"].sensor("tip")
    with pytest.raises(RippleError, match="bodies 'b' and 'a', which move"):
        ripples["target"].sensor("off")
