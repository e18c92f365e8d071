"""The rest filter's effect: noise under bodies at rest, hits after a rest, driven surfaces.

    python examples/benchmarks/rest.py

Each case runs with the filter and without it on the same physics, and the velocities of the two
surfaces are compared (root of the mean square over the mass).
"""

import mujoco
import numpy as np

from ripple_sim import Material, Ripples
from ripple_sim.coupling import ContactLoads, CoupledModel
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Load, WaveSolver

MATERIAL = Material(speed=0.6, damping=5.0, stiffness=1000.0, viscosity=3e-4, density=100.0)
GRAVITY = 9.81
TARGETS = {
    "sphere": ('type="sphere" size="2" pos="0 0 -2"', 0.0),
    "box": ('type="box" size="0.5 0.5 0.1" pos="0 0 -0.1"', 0.0),
    "sdf": ('type="sdf" mesh="animal" pos="0.03 0 -0.446"', 0.01),
}
BODIES = {
    "ball": 'type="sphere" size="0.05"',
    "box": 'type="box" size="0.06 0.05 0.04"',
    "capsule": 'type="capsule" size="0.03 0.05" euler="90 0 0"',
    "cylinder": 'type="cylinder" size="0.05 0.03"',
}


def model_of(target: str, bodies: str, dt: float, solref: str = "0.02 1") -> mujoco.MjModel:
    V, F = limbed(0.03)
    mesh = (
        f'<mesh name="animal" vertex="{" ".join(map(str, V.ravel()))}" '
        f'face="{" ".join(map(str, F.ravel()))}"/>'
    )
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{dt}" sdf_initpoints="10"/>
        <default><geom solref="{solref}" friction="1 0.05 0.05" condim="6"/></default>
        <asset>{mesh}</asset>
        <worldbody><geom name="target" {TARGETS[target][0]}/>{bodies}</worldbody></mujoco>"""
    )


def velocity(waves: WaveSolver) -> float:
    mass = waves.operator.mass
    return float(np.sqrt((mass * waves.velocity.astype(np.float64) ** 2).sum() / mass.sum()))


def run(model: mujoco.MjModel, seconds: float, act=lambda data: None) -> np.ndarray:
    """Velocities with and without the filter [m/s], [steps, 2]; `act` runs before each step."""
    data = mujoco.MjData(model)
    dt = model.opt.timestep
    options = {"backend": "cpu", "conserve_volume": False}
    ripples = Ripples(model, {"target": MATERIAL}, resolution=24, **options)
    unfiltered = WaveSolver(ripples["target"].atlas, MATERIAL, **options)
    contacts = ContactLoads(CoupledModel(model), {model.geom("target").id: unfiltered})
    history = []
    for _ in range(round(seconds / dt)):
        act(data)
        mujoco.mj_step(model, data)
        ripples.step(data)
        contacts.skip()
        contacts.loads(data, dt)
        given = [done.on_texels for done in contacts.since_skip]
        unfiltered.step(dt, load=Load.together([Load(each.texels, each.forces) for each in given]))
        history.append((velocity(ripples["target"]), velocity(unfiltered)))
    return np.array(history)


def noise() -> None:
    print(
        "velocity 5 s after a body has fallen from 0.2 m, over the highest: without the filter, "
        "with it"
    )
    for target, body, solref, dt in (
        ("sphere", "ball", "0.02 1", 0.002),
        ("sphere", "ball", "0.01 0.2", 0.002),
        ("box", "box", "0.01 0.2", 0.002),
        ("sdf", "ball", "0.01 0.2", 0.002),
        ("sdf", "box", "0.02 1", 0.0005),
        ("sdf", "box", "0.02 1", 0.002),
        ("sdf", "box", "0.02 1", 0.004),
        ("sdf", "box", "0.01 0.2", 0.002),
        ("sdf", "capsule", "0.02 1", 0.002),
        ("sdf", "cylinder", "0.02 1", 0.002),
    ):
        place = (
            f'<body pos="0 0 {TARGETS[target][1] + 0.2}"><freejoint/><geom {BODIES[body]} '
            f'mass="0.5"/></body>'
        )
        history = run(model_of(target, place, dt, solref), 5.0)
        filtered, unfiltered = np.sqrt(
            (history[-round(0.5 / dt) :] ** 2).mean(axis=0)
        ) / history.max(axis=0)
        print(
            (
                f"{body:9}on {target:7} solref {solref:9} dt {1e3 * dt:3g} ms {unfiltered:9.2%} "
                f"{filtered:9.3%}"
            ),
            flush=True,
        )


def hit(target: str, rest: float, mass: float, speed: float, off: float) -> float:
    """Highest velocity after a hammer hits a block at rest, over that without the filter."""
    top = TARGETS[target][1]
    bodies = f"""<body name="block" pos="0 0 {top + 0.041}"><freejoint/>
        <geom {BODIES["box"]} mass="0.5" conaffinity="3"/></body>
        <body name="hammer" pos="{off} 0 {top + 0.5}" gravcomp="1">
        <joint name="hammer" type="slide" axis="0 0 1"/>
        <geom size="0.03" mass="{mass}" contype="2" conaffinity="2"/></body>"""
    model = model_of(target, bodies, 0.002)
    joint = model.joint("hammer")
    struck = []

    def strike(data: mujoco.MjData) -> None:
        if data.time >= rest and not struck:
            above = data.body("block").xpos[2] + 0.04 + 0.03 + 0.002
            data.qpos[joint.qposadr] = above - model.body("hammer").pos[2]
            data.qvel[joint.dofadr] = -speed
            struck.append(True)

    filtered, unfiltered = run(model, rest + 0.2, strike)[round(rest / 0.002) :].max(axis=0)
    return filtered / unfiltered


def hits() -> None:
    rests = (0.05, 0.2, 1.0, 3.0, 10.0)
    print(
        "\na hammer strikes a block after a rest of",
        *rests,
        "s: velocity over that without the filter",
    )
    for target, off, mass, speed in (
        ("box", 0.0, 1.0, 3.0),
        ("box", 0.03, 1.0, 3.0),
        ("box", 0.0, 0.02, 0.2),
        ("sdf", 0.03, 1.0, 3.0),
    ):
        ratios = [hit(target, rest, mass, speed, off) for rest in rests]
        what = f"{mass} kg at {speed} m/s, {100 * off:g} cm off the middle, on {target}"
        print(f"{what:52}", *(f"{ratio:6.3f}" for ratio in ratios), flush=True)


def driving() -> None:
    print(
        "\na rod pushed with 0.8 of its weight, in unbroken contact for 6 s: velocity over that "
        "without the filter"
    )
    for target in TARGETS:
        rod = f"""<body pos="0 0 {TARGETS[target][1] + 0.06}">
        <joint name="rod" type="slide" axis="0 0 1"/>
            <geom type="capsule" size="0.03 0.03" mass="1"/></body>"""
        ratios = []
        for frequency in (0.5, 5.0, 50.0):
            model = model_of(target, rod, 0.002)

            def push(data: mujoco.MjData, frequency: float = frequency) -> None:
                data.qfrc_applied[0] = 0.8 * GRAVITY * np.sin(2 * np.pi * frequency * data.time)

            filtered, unfiltered = np.sqrt((run(model, 6.0, push)[-1000:] ** 2).mean(axis=0))
            ratios.append(f"{frequency:5g} Hz {filtered / unfiltered:6.3f}")
        print(f"{target:9}", *ratios, flush=True)


if __name__ == "__main__":
    noise()
    hits()
    driving()
