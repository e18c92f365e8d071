"""Random scenes with two-way coupling: does the energy of bodies and waves ever rise?

    python examples/benchmarks/energy_ledger.py [SCENES] [SEED]

A body falls on a target, or flies at it. Masses, time steps, materials, geom types, joints of the
target, contact damping and MuJoCo's options are random: its solver, integrator, cone, Jacobian,
noslip iterations, and all flags but those that leave nothing to see, as without contacts or
gravity. What counts is the greatest rise of the energy of bodies and waves together over its
largest value so far, as a share of that; potential energy counts from where the body touches. No
actuators act.
"""

from __future__ import annotations

import sys
import time
import warnings
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco_flags import FLAGS

from ripple_sim import Material, RippleError, Ripples

BAR = 0.01
GEOMS = {
    "sphere": "{r}",
    "capsule": "{r} {r}",
    "cylinder": "{r} {r}",
    "ellipsoid": "{r} {s} {s}",
    "box": "{r} {s} {s}",
    "mesh": "",
}
TARGETS = {
    "box": 'type="box" size="0.5 0.4 0.1"',
    "cylinder": 'type="cylinder" size="0.5 0.1"',
    "sphere": 'type="sphere" size="0.5"',
    "ellipsoid": 'type="ellipsoid" size="0.6 0.5 0.3"',
    "capsule": 'type="capsule" size="0.3 0.3" euler="0 90 0"',
    "mesh": 'type="mesh" mesh="prism"',
}
TOPS = {"box": 0.1, "cylinder": 0.1, "sphere": 0.5, "ellipsoid": 0.3, "capsule": 0.3, "mesh": 0.1}
JOINTS = {
    "fixed": "",
    "free": "<freejoint/>",
    "slide": '<joint type="slide" axis="0 0 1" springref="0.0245" stiffness="{k}" damping="{d}"/>',
    "hinge": '<joint type="hinge" axis="0 1 0" stiffness="{k}" damping="{d}"/>',
}
PRISM = "-.5 -.4 -.1  .5 -.4 -.1  .5 .4 -.1  -.5 .4 -.1  -.4 -.3 .1  .4 -.3 .1  .4 .3 .1  -.4 .3 .1"
STONE = "-1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  0 0 1.2"


SOLVERS = ("Newton", "CG", "PGS")
JACOBIANS = ("dense", "sparse", "auto")
CONES = ("pyramidal", "elliptic")
# RK4 is refused; "discrete" came with MuJoCo 3.17, and does not take PGS
INTEGRATORS = ("Euler", "implicit", "implicitfast", "discrete")


def random_options(rng: np.random.Generator) -> tuple[str, str]:
    """Attributes of <option> and of <flag>: of flags half are named."""
    solver, jacobian, cone = (str(rng.choice(each)) for each in (SOLVERS, JACOBIANS, CONES))
    known = hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE") and solver != "PGS"
    integrator = str(rng.choice(INTEGRATORS if known else INTEGRATORS[:-1]))
    noslip = rng.choice([0, 0, 5])
    impratio = rng.choice([1, 1, 10])
    options = (
        f'solver="{solver}" jacobian="{jacobian}" cone="{cone}" integrator="{integrator}" '
        f'noslip_iterations="{noslip}" impratio="{impratio}"'
    )
    chosen = {flag: str(rng.choice(["disable", "enable"])) for flag in FLAGS if rng.random() < 0.5}
    if integrator == "discrete":
        # it cannot do without islands
        chosen["island"] = "enable"
    return options, " ".join(f'{flag}="{value}"' for flag, value in chosen.items())


class Scene(NamedTuple):
    """A model, its material, how long it runs [s], and what it is in words."""

    model: mujoco.MjModel
    material: Material
    duration: float
    words: str


def random_scene(rng: np.random.Generator) -> Scene:
    """A body on its way to a target."""
    shape, target, joint = (str(rng.choice(list(each))) for each in (GEOMS, TARGETS, JOINTS))
    dt = float(rng.uniform(0.5e-3, 4e-3))
    mass = float(10 ** rng.uniform(-3, 3))
    radius = float(rng.uniform(0.04, 0.12))
    size = GEOMS[shape].format(r=radius, s=0.7 * radius)
    kind = f'type="{shape}" mesh="stone"' if shape == "mesh" else f'type="{shape}" size="{size}"'
    contact = [
        "",
        'solref="0.02 1"',
        'solref="0.02 0.05"',
        'solref="-10000 0"',
        'solref="-3000 -20"',
    ][rng.integers(5)]
    fall = float(rng.uniform(0.02, 0.4))
    weight = float(10 ** rng.uniform(0, 3))
    spring = JOINTS[joint].format(k=weight * 400, d=rng.choice([0.0, weight]))
    x, y = rng.uniform(-0.15, 0.15, 2)
    angles = " ".join(f"{each:.1f}" for each in rng.choice([0.0, 1.0]) * rng.uniform(-180, 180, 3))
    options, flags = random_options(rng.spawn(1)[0])
    # a free target floats: the body flies at it
    free = joint == "free"
    gravity = 0.0 if free else -9.81
    above = TOPS[target] + 1.8 * radius
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{dt}" {options} gravity="0 0 {gravity}"><flag {flags}/>
        </option>
        <asset><mesh name="prism" vertex="{PRISM}"/>
        <mesh name="stone" vertex="{STONE}" scale="{0.6 * radius} {0.6 * radius} {0.6 * radius}"/>
        </asset>
        <default><geom {contact}/></default><worldbody>
        <body>{spring}<geom name="target" {TARGETS[target]} mass="{weight}"/></body>
        <body name="body" pos="{x} {y} {above + fall}" euler="{angles}"><freejoint/>
        <geom {kind} mass="{mass}"/></body></worldbody></mujoco>"""
    )
    density = float(10 ** rng.uniform(0, 4))
    chosen = int(rng.integers(3))
    if chosen == 0:
        material = Material()
    elif chosen == 1:
        material = Material(density=density)
    else:
        material = Material(
            speed=float(rng.uniform(0.3, 3.0)),
            density=density,
            damping=float(rng.choice([0.0, rng.uniform(0, 5)])),
            stiffness=float(rng.choice([0.0, (rng.uniform(0, 1) / dt) ** 2])),
            viscosity=float(rng.choice([0.0, 1e-3])),
        )
    words = (
        f"{shape} of {mass:.3g} kg, {joint} {target} of {weight:.3g} kg, dt {1e3 * dt:.2f} ms, "
        f"{contact or 'default contact'}, {options}, {flags}"
    )
    return Scene(model, material, 0.8, words)


def rise(scene: Scene, *, own: bool = True, rigid: bool = False) -> tuple[float, str]:
    """Greatest rise as a share of the largest energy so far, and the material in words.

    Steps are taken by `Ripples.mj_step` (`own`), by `mujoco.mj_step` and `Ripples.step`, or, if the
    target is `rigid`, by MuJoCo alone.
    """
    model = scene.model
    data = mujoco.MjData(scene.model)
    if not model.opt.gravity[2]:
        data.qvel[-4] = -2.0
    ripples = Ripples(model, {"target": scene.material}, resolution=24, backend="cpu", two_way=True)
    energy = ripples.energy(data)
    # potential energy counts from where the body touches
    largest = model.body_mass[2] * (-model.opt.gravity[2] * _drop(scene) + data.qvel[-4] ** 2 / 2)
    touch = energy.total - largest
    worst = 0.0
    waves = 0.0
    while data.time < scene.duration:
        if own and not rigid:
            ripples.mj_step(data)
        else:
            mujoco.mj_step(model, data)
            if not rigid:
                ripples.step(data)
        energy = ripples.energy(data)
        worst = max(worst, (energy.total - touch - largest) / largest)
        largest = max(largest, energy.total - touch)
        waves = max(waves, energy.waves)
    material = ripples["target"].material
    speed, density, stiffness = (
        np.mean(each) for each in (material.speed, material.density, material.stiffness)
    )
    words = (
        f"c {speed:.3g}, rho {density:.3g}, sqrt(k) dt {stiffness**0.5 * model.opt.timestep:.2f}"
    )
    return float(worst), f"{words}; waves have up to {waves / largest:.2%}"


def _drop(scene: Scene) -> float:
    """How far the body falls before it touches [m]."""
    data = mujoco.MjData(scene.model)
    start = data.qpos[-5]
    mujoco.mj_forward(scene.model, data)
    while not data.ncon and data.qpos[-5] > start - 1.0:
        data.qpos[-5] -= 1e-3
        mujoco.mj_forward(scene.model, data)
    return float(start - data.qpos[-5])


def main(count: int = 300, seed: int = 0) -> None:
    """Run the scenes, and print those beyond the bar and how many pass."""
    warnings.simplefilter("ignore")
    for own, way in (
        (True, "ripples.mj_step(data)"),
        (False, "mujoco.mj_step, ripples.step(data)"),
    ):
        found = []
        begun = time.perf_counter()
        for index in range(count):
            scene = random_scene(np.random.default_rng([seed, index]))
            try:
                rises, words = rise(scene, own=own)
            except RippleError as error:
                rises = np.inf
                words = str(error)
            found.append(rises)
            if rises > BAR:
                alone = rise(scene, rigid=True)[0]
                print(
                    (
                        f"  {index}: {rises:.2%}, {alone:.2%} with a rigid target: {scene.words}; "
                        f"{words}"
                    ),
                    flush=True,
                )
        took = time.perf_counter() - begun
        passed = np.sum(np.array(found) <= BAR)
        beyond = max(found)
        print(
            f"{way}: {passed} of {count} within {BAR:.0%}, the worst {beyond:.2%}; {took:.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
