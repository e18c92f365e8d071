"""A batch of random scenes, and what their target underwent, read back with `load_batch`.

    python examples/batch_impulses.py [--scenes 20] [--seconds 1.5] [--workers 2]

Makes out/batch_impulses.png: every touch of every scene, its impulse over the height of the ripples
at that time, and where on the target it fell. No frame is drawn; such a batch is for statistics or
for learning. Started again, it makes only what is missing in out/batch_impulses.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ripple_sim import RunOptions, load_batch, read_plan, run_batch

MODEL = """<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <geom name="floor" type="plane" size="3 3 1"/>
    <geom name="egg" type="ellipsoid" size="0.45 0.3 0.3" pos="0 0 0.3"/>
    <body name="a" pos="-0.2 0 1.0"><freejoint/><geom name="a" size="0.06" density="400"/></body>
    <body name="b" pos="0.0 0 1.3"><freejoint/><geom name="b" size="0.06" density="400"/></body>
    <body name="c" pos="0.2 0 1.6"><freejoint/><geom name="c" size="0.06" density="400"/></body>
  </worldbody>
</mujoco>"""

SCENE = """
model = "model.xml"
[[ripple]]
geom = "egg"
resolution = 64
material = {speed = 0.6, damping = 1.5, stiffness = 300, density = 2000}
[random]
position = 0.15
orientation = true
size = [0.6, 1.4]
shapes = ["sphere", "box", "capsule", "cylinder", "ellipsoid"]
"""

PLAN = """
scenes = ["scene.toml"]
count = {scenes}
[model]
"geom[?].mass" = {{log_uniform = [0.5, 2.0], apply = "multiply"}}
[store]
video = "none"
fps = 100
duration = {seconds}
heights = true
"""


def touches(folder: Path) -> np.ndarray:
    """The touches of each scene: place [m], impulse [N s] and highest ripple meanwhile [m]."""
    found = []
    for scene in load_batch(folder):
        highest = np.abs(scene.heights()["egg"]).max(axis=(1, 2, 3))
        hits = scene.impulses()
        for other in np.unique(hits["other"]):
            of_body = hits[hits["other"] == other]
            apart = np.flatnonzero(np.diff(of_body["frame"]) > 1) + 1
            for touch in np.split(of_body, apart):
                during = highest[touch["frame"][0] : touch["frame"][-1] + 1]
                x, y = touch[["x", "y"]][0]
                found.append((scene.number, x, y, touch["impulse"].sum(), during.max()))
    return np.array(
        found, [("scene", int), *((name, float) for name in ("x", "y", "impulse", "ripple"))]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="Random scenes, and what their target underwent.")
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=1.5)
    parser.add_argument("--workers", type=int)
    options = parser.parse_args()
    folder = Path("out/batch_impulses")
    (folder / "plan").mkdir(parents=True, exist_ok=True)
    for name, text in (
        ("model.xml", MODEL),
        ("scene.toml", SCENE),
        ("plan.toml", PLAN.format(**vars(options))),
    ):
        (folder / "plan" / name).write_text(text)
    run_batch(
        read_plan(folder / "plan" / "plan.toml"),
        folder / "scenes",
        RunOptions(workers=options.workers),
    )
    found = touches(folder / "scenes")
    print(f"{options.scenes} scenes, {len(found)} touches")
    for name, unit in (("impulse", "N s"), ("ripple", "m")):
        least = found[name].min()
        mean = found[name].mean()
        most = found[name].max()
        print(f"{name}: {least:.3g} to {most:.3g} {unit}, mean {mean:.3g} {unit}")
    figure = Figure(figsize=(11, 4.6), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2)
    left.scatter(
        found["impulse"], 1000 * found["ripple"], s=30, c="#1f6f8b", alpha=0.7, linewidths=0
    )
    left.set(xscale="log", yscale="log", xlabel="impulse [N s]", ylabel="highest ripple [mm]")
    colors = right.scatter(
        found["x"], found["y"], s=30, c=found["impulse"], cmap="viridis", norm="log"
    )
    angle = np.linspace(0, 2 * np.pi, 200)
    right.plot(0.45 * np.cos(angle), 0.3 * np.sin(angle), color="#9aa3ad", linewidth=1)
    right.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="seen from above")
    figure.colorbar(colors, label="impulse [N s]", shrink=0.8)
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    path = Path("out/batch_impulses.png")
    figure.savefig(path)
    print(path)


if __name__ == "__main__":
    main()
