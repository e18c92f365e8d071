"""A gripper's pad feels a ball, a rod and a cube's edge: depth, imprint and pressure of its skin.

    python examples/pad_imprints.py

Makes out/pad_imprints.png. MuJoCo's `tactile` sensor tells how deep each body is in the pad. The
pad's skin is a membrane on soft foam, and held at its rim: `press` finds how it lies at rest, and
with which force it is pressed at each taxel.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np

from ripple_sim import Material, Ripples, Target
from ripple_sim.solver import Imprint

SIDE = 0.04  # of the pad [m]
TAXELS = 33  # along a side
RESOLUTION = 48
DEPTH = 0.0015  # of each body in the pad [m]
SPACING = SIDE / (TAXELS - 1)  # [m]
# tension density speed^2 = 40 N/m, and foam of density stiffness = 4e5 N/m^3
SKIN = Material(speed=20.0, density=0.1, stiffness=4e6)

# geom of each body, and the height of its middle above its lowest point [m]
BODIES = {
    "ball": ('type="sphere" size=".012"', 0.012),
    "rod": ('type="capsule" size=".004 .01" euler="90 0 30"', 0.004),
    "edge of a cube": ('type="box" size=".009 .009 .009" euler="0 45 0"', 0.009 * 2**0.5),
}


def sheet(count: int) -> str:
    """Attributes of a square mesh of `count` x `count` vertices in the plane z = 0."""
    along = np.linspace(-SIDE / 2, SIDE / 2, count)
    x, y = np.meshgrid(along, along)
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    corner = np.arange(count**2).reshape(count, count)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).ravel()
    normals = np.tile([0, 0, 1], x.size)
    texts = [" ".join(f"{value:g}" for value in array.ravel()) for array in (vertices, normals)]
    return f'vertex="{texts[0]}" normal="{texts[1]}" face="{" ".join(map(str, faces))}"'


def model_of(geom: str, height: float) -> mujoco.MjModel:
    """A body above the pad; the pad's top is the plane z = 0."""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <asset>
        <mesh name="taxels" inertia="shell" {sheet(TAXELS)}/>
        <mesh name="skin" inertia="shell" {sheet(9)}/>
      </asset>
      <worldbody>
        <geom name="pad" type="box" size="{SIDE / 2} {SIDE / 2} .01"/>
        <geom name="skin" type="mesh" mesh="skin" pos="0 0 .01" contype="0" conaffinity="0"/>
        <body pos="0 0 {0.01 + height - DEPTH}"><freejoint/><geom {geom}/></body>
      </worldbody>
      <sensor><tactile name="touch" geom="pad" mesh="taxels"/></sensor></mujoco>""")
    # MuJoCo turns a mesh into its principal frame; the sensor reads its vertices in the pad's frame
    mesh = model.mesh("taxels").id
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    taxels = model.mesh_vert[first : first + count]
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.mesh_quat[mesh])
    taxels[:] = taxels @ rotation.reshape(3, 3).T + model.mesh_pos[mesh] + [0, 0, 0.01]
    return model


def feel(model: mujoco.MjModel) -> tuple[np.ndarray, Imprint, np.ndarray]:
    """Depth at each taxel [m], the imprint on the skin, and places of its texels [m]."""
    data = mujoco.MjData(model)
    skin = Target(material=SKIN, resolution=RESOLUTION, rim="supported", contacts=["pad"])
    ripples = Ripples(model, {"skin": skin})
    mujoco.mj_forward(model, data)
    depths = data.sensor("touch").data[: TAXELS**2]
    first = model.mesh_vertadr[model.mesh("taxels").id]
    taxels = model.mesh_vert[first : first + TAXELS**2]  # the pad's frame is the world's
    waves = ripples["skin"]
    imprint = waves.press(waves.from_world(taxels, data), depths=depths, radius=1.5 * SPACING)
    return depths, imprint, waves.to_world(waves.atlas.positions, data)


def main() -> Path:
    figure, axes = plt.subplots(3, len(BODIES), figsize=(9, 8.4), sharex=True, sharey=True)
    extent = [-500 * SIDE, 500 * SIDE] * 2
    for column, (name, (geom, height)) in enumerate(BODIES.items()):
        depths, imprint, places = feel(model_of(geom, height))
        x, y = 1e3 * places.reshape(-1, 3)[:, :2].T
        grid = 1e3 * depths.reshape(TAXELS, TAXELS)
        axes[0, column].imshow(grid, origin="lower", extent=extent, cmap="viridis")
        lowered = -1e3 * imprint.height.ravel()
        axes[1, column].tripcolor(x, y, lowered, shading="gouraud", cmap="viridis")
        kilopascals = 1e-3 * imprint.pressure.ravel()
        axes[2, column].tripcolor(x, y, kilopascals, shading="gouraud", cmap="magma")
        force = imprint.forces.sum()
        axes[0, column].set_title(f"{name}, {force:.2f} N")
        print(f"{name}: deepest {grid.max():.2f} mm, {force:.3f} N")
    for row, title in enumerate(("depth at the taxels", "imprint of the skin", "pressure")):
        axes[row, 0].set_ylabel(f"{title}\ny [mm]")
    for place in axes.ravel():
        place.set_aspect("equal")
    figure.tight_layout()
    path = Path("out/pad_imprints.png")
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=110)
    return path


if __name__ == "__main__":
    print(main())
