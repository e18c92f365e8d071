"""Heights of the waves of a ball and of a heavy box: two choices of default material.

python examples/benchmarks/sensible.py MESH (with y up; its longest extent becomes 1 m)
"""

import dataclasses
import sys
import warnings

import mujoco
import numpy as np

from ripple_sim import Material, Ripples
from ripple_sim.solver import load_mesh

BOX = """<mujoco><worldbody><geom name="target" type="box" size="0.5 0.5 0.25"/>
<body pos="0 0 0.36"><freejoint/><geom type="box" size="0.15 0.15 0.1" mass="20"/></body>
</worldbody></mujoco>"""


def mesh_under_ball(path: str, mass: float) -> mujoco.MjModel:
    """A mesh of 1 m, and a ball that reaches it at 4.5 m/s."""
    mesh = load_mesh(path)
    V = mesh.V[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    V /= np.ptp(V, axis=0).max()
    spec = mujoco.MjSpec()
    spec.option.sdf_initpoints = 8
    spec.add_mesh(name="target", uservert=V.ravel(), userface=mesh.F.ravel())
    spec.worldbody.add_geom(name="target", type=mujoco.mjtGeom.mjGEOM_SDF, meshname="target")
    body = spec.worldbody.add_body(pos=[0.0, 0.0, V[:, 2].max() + 1.09])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0, 0], mass=mass)
    return spec.compile()


def run(case: str, model: mujoco.MjModel, material: Material, seconds: float) -> None:
    """Print a row: the greatest height, the material, and whether a warning was given."""
    ripples = Ripples(model, {"target": material}, resolution=64, backend="cpu")
    data = mujoco.MjData(model)
    top = 0.0
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        while data.time < seconds:
            mujoco.mj_step(model, data)
            ripples.step(data)
            top = max(top, float(np.abs(ripples["target"].height).max()))
    m = ripples["target"].material
    chosen = ", ".join(
        f"{getattr(m, name):.3g}" for name in ("speed", "damping", "stiffness", "density")
    )
    print(f"| {case} | {chosen} | {top:.2g} m | {'yes' if caught else 'no'} |", flush=True)


def main() -> None:
    print(
        "| case | speed, damping, stiffness, density | highest | warned |\n| --- | --- | --- | --- "
        "|"
    )
    free = Material(speed=1.0, damping=0.0, stiffness=0.0, density=1.0)
    slow = dataclasses.replace(free, speed=0.6, damping=1.0)
    light = mesh_under_ball(sys.argv[1], 0.36)
    heavy = mesh_under_ball(sys.argv[1], 1.7)
    for name, before, after in (
        ("`Material()`", free, Material()),
        ("`Material(speed=0.6, damping=1.0)`", slow, Material(speed=0.6, damping=1.0)),
    ):
        run(f"ball of 0.36 kg, {name}, before", light, before, 1.3)
        run(f"ball of 0.36 kg, {name}, now", light, after, 1.3)
    box = mujoco.MjModel.from_xml_string(BOX)
    run("box of 20 kg at rest, `Material()`, before", box, free, 3.0)
    run("box of 20 kg at rest, `Material()`, now", box, Material(), 3.0)
    run("ball of 1.7 kg, `Material.jelly()`", heavy, Material.jelly(), 1.3)
    run(
        "ball of 1.7 kg, `Material.suited(1.0, (1.7, 4.5))`",
        heavy,
        Material.suited(1.0, (1.7, 4.5)),
        1.3,
    )


if __name__ == "__main__":
    main()
