"""A batch of random scenes: the same model with other places, shapes and masses by each seed, and what the target felt.

    python examples/random_batch.py [--scenes 20] [--seconds 1.5]

Makes out/random_batch.png: every hit of every scene, its impulse over the height of the ripples that it left, and
where on the target it fell. No frame is drawn; such a batch is for statistics or for learning.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ripple_sim.scene.load_scene import load_scene
from ripple_sim.simulation import Simulation

MODEL = """<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <geom name="floor" type="plane" size="3 3 1"/>
    <geom name="egg" type="ellipsoid" size="0.45 0.3 0.3" pos="0 0 0.3"/>
    <body name="a" pos="-0.2 0 1.0"><freejoint/><geom size="0.06" density="400"/></body>
    <body name="b" pos="0.0 0 1.3"><freejoint/><geom size="0.06" density="400"/></body>
    <body name="c" pos="0.2 0 1.6"><freejoint/><geom size="0.06" density="400"/></body>
  </worldbody>
</mujoco>"""

SCENE = """
model = "model.xml"
[[ripple]]
geom = "egg"
resolution = 64
[ripple.material]
speed = 0.6
damping = 1.5
stiffness = 300
density = 2000
[random]
seed = {seed}
position = 0.15
orientation = true
size = [0.6, 1.4]
mass = [0.5, 2.0]
shapes = ["sphere", "box", "capsule", "cylinder", "ellipsoid"]
"""


def hits(seed: int, seconds: float, folder: Path) -> list[tuple[float, float, float, float]]:
    """Simulate one scene: x, y [m], impulse [N s] and highest ripple [m] of each touch, from first to last contact."""
    path = folder / f"scene_{seed}.toml"
    path.write_text(SCENE.format(seed=seed))
    simulation = Simulation(load_scene(path), fps=100, backend="cpu")
    found, touching = [], {}
    for _ in range(round(seconds * 100)):
        simulation.advance_frame()
        highest = float(np.abs(simulation.ripples["egg"].height).max())
        now = {}
        for hit in simulation.impulses:
            point, impulse, ripple = touching.get(hit.other, (hit.point, 0.0, 0.0))
            earlier = now.get(hit.other, (point, impulse, ripple))
            now[hit.other] = (earlier[0], earlier[1] + hit.impulse, max(earlier[2], highest))
        for other in touching.keys() - now.keys():
            point, impulse, ripple = touching[other]
            found.append((float(point[0]), float(point[1]), impulse, ripple))
        touching = now
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="Random scenes, and what their target felt.")
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=1.5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "model.xml").write_text(MODEL)
        found = np.array([hit for seed in range(options.scenes) for hit in hits(seed, options.seconds, folder)])
    print(
        f"{options.scenes} scenes, {len(found)} hits, impulses {found[:, 2].min():.3f} to {found[:, 2].max():.3f} N s"
    )
    figure = Figure(figsize=(11, 4.6), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2)
    left.scatter(found[:, 2], 1000 * found[:, 3], s=30, c="#1f6f8b", alpha=0.7, linewidths=0)
    left.set(xscale="log", yscale="log", xlabel="impulse [N s]", ylabel="highest ripple [mm]")
    colors = right.scatter(found[:, 0], found[:, 1], s=30, c=found[:, 2], cmap="viridis", norm="log")
    angle = np.linspace(0, 2 * np.pi, 200)
    right.plot(0.45 * np.cos(angle), 0.3 * np.sin(angle), color="#9aa3ad", linewidth=1)
    right.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="seen from above")
    figure.colorbar(colors, label="impulse [N s]", shrink=0.8)
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    path = Path("out/random_batch.png")
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path)
    print(path)


if __name__ == "__main__":
    main()
