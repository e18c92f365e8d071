"""Where does the energy go? A wave without damping, by each operator, and a wave with it.

    python examples/plots/energy.py [--steps 4000]

writes out/plots/energy.png. All are measured alike, as `WaveSolver.energy` does for the finite
elements.
"""

import argparse
from pathlib import Path

import numpy as np
from figure import COLORS, FOLDER, NAMES, TEXT, plain, save, sheet

from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Material, Mesh, WaveSolver, build_atlas

SAMPLES = 200
DAMPINGS = (0.25, 0.5, 1.0)  # 1/s


def energies(atlas: Atlas, operator: str, material: Material, times: np.ndarray) -> np.ndarray:
    """Energy over the initial energy, at given times [s], after the release of a bump."""
    waves = WaveSolver(atlas, material, operator=operator, backend="cpu")
    measure = waves if operator == "fem" else WaveSolver(atlas, material, backend="cpu")
    away = np.linalg.norm(atlas.positions - atlas.mesh.V[0], axis=-1)
    waves.add_height(np.exp(-((away / (0.08 * np.sqrt(atlas.mesh.area))) ** 2) / 2))
    result = []
    for dt in np.diff(times, prepend=0.0):
        waves.step(dt)
        if measure is not waves:
            measure.height = waves.height
            measure.velocity = waves.velocity
        result.append(measure.energy())
    return np.array(result) / result[0]


def make(folder: Path, steps: int = 4000, resolution: int = 64) -> Path:
    atlas = build_atlas(Mesh.from_arrays(*limbed()), resolution)
    step = WaveSolver(atlas, backend="cpu").stable_timestep
    times = np.linspace(0, steps * step, SAMPLES)
    figure = sheet(
        13.0,
        4.9,
        "Energy of a wave",
        f"a bump let go on a body with limbs, 6 x {resolution} x {resolution} texels, at 1 m/s",
    )
    kept = figure.add_axes((0.06, 0.13, 0.40, 0.61))
    plain(kept, "time [s]", "energy / energy at the start")
    kept.set_title(f"no damping, {steps:,} steps", fontsize=11, color=TEXT, loc="left")
    for operator, name in NAMES.items():
        share = energies(atlas, operator, Material(), times)
        change = 100 * np.abs(share - 1).max()
        label = (
            f"{name}: {change:.0f} %"
            if change > 1
            else f"{name}: below {10 ** np.ceil(np.log10(change)):.6f} %"
        )
        kept.plot(
            times,
            share,
            color=COLORS[operator],
            linewidth=1.8 if operator == "fem" else 1.2,
            label=label,
        )
    kept.set_ylim(0, 5.0)
    kept.legend(
        frameon=False,
        fontsize=9.5,
        labelcolor=TEXT,
        ncols=2,
        loc="upper left",
        title="largest change",
    )

    lost = figure.add_axes((0.56, 0.13, 0.40, 0.61))
    plain(lost, "time [s]", "energy / energy at the start")
    lost.set_title("damping: dots are exp(-zeta t)", fontsize=11, color=TEXT, loc="left")
    short = times[times <= 8.0]
    for damping, shade in zip(DAMPINGS, ("#7fb2df", "#3f86c6", "#1f4e8c"), strict=True):
        share = energies(atlas, "fem", Material(damping=damping), short)
        lost.semilogy(short, share, color=shade, linewidth=1.6, label=f"zeta = {damping:g} 1/s")
        lost.plot(short[::6], np.exp(-damping * short[::6]), "o", color=shade, markersize=3)
    lost.legend(frameon=False, fontsize=9.5, labelcolor=TEXT)
    return save(figure, folder, "energy")


def main() -> None:
    parser = argparse.ArgumentParser(description="Energy of a wave over time, by each operator.")
    parser.add_argument("--steps", type=int, default=4000)
    print(make(FOLDER, parser.parse_args().steps))


if __name__ == "__main__":
    main()
