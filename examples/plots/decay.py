"""Decay of waves: standing waves with damping, viscosity and a viscous layer; a sphere.

    python examples/plots/decay.py [--texels 96]

writes out/plots/decay.png and prints the errors.
"""

import argparse
from pathlib import Path

import numpy as np
from figure import COLORS, FOLDER, TEXT, plain, save, sheet
from layer_mode import lowest_square
from matplotlib.axes import Axes
from scipy.special import eval_legendre
from standing_wave import flat_torus, plane_wave, swung

from ripple_sim.solver import Material, sphere_atlas

# 1/s, m^2/s
DAMPINGS = (0.25, 0.5, 1.0, 2.0, 4.0)
VISCOSITIES = (0.002, 0.005, 0.01, 0.02)
# gelatine of 3 %
MODULUS = 2010.0
VISCOSITY = 0.6
DENSITY = 1000.0
DEPTH = 1.3 / (2 * np.pi)


def draw(axes: Axes, title: str, x: list[float], measured: list[float], exact: list[float]) -> None:
    error = np.abs(np.array(measured) / np.array(exact) - 1).max()
    print(f"{title:32} largest error {error:.2%}")
    axes.plot(x, exact, color=COLORS["paper"], linewidth=1.4)
    axes.plot(x, measured, "o", color=COLORS["fem"], markersize=4.5)
    axes.set_title(f"{title}: {error:.1%}", fontsize=11, color=TEXT, loc="left")
    axes.set_ylim(0.0, None)


def make(folder: Path, texels: int = 96) -> Path:
    figure = sheet(
        13.0,
        4.5,
        "Decay, and the modes of a sphere",
        "dots are measured from the swing, lines are theory",
    )
    panels = [figure.add_axes((0.06 + 0.242 * k, 0.15, 0.185, 0.57)) for k in range(4)]
    torus = flat_torus(texels)
    q = 4 * np.pi
    plain(panels[0], "damping zeta [1/s]", "decay rate [1/s]")
    rates = [plane_wave(torus, Material(damping=zeta), q)[1] for zeta in DAMPINGS]
    draw(panels[0], "damping", list(DAMPINGS), rates, [zeta / 2 for zeta in DAMPINGS])
    plain(panels[1], "viscosity nu [m^2/s]", "")
    rates = [plane_wave(torus, Material(viscosity=nu), q)[1] for nu in VISCOSITIES]
    draw(panels[1], "viscosity", list(VISCOSITIES), rates, [nu * q**2 / 2 for nu in VISCOSITIES])
    plain(panels[2], "wave number times thickness", "")
    material = Material.layer(MODULUS, VISCOSITY, DENSITY, DEPTH)
    depths = [1.3 * k for k in range(1, 7)]
    rates = [plane_wave(torus, material, depth / DEPTH)[1] for depth in depths]
    exact = [VISCOSITY / DENSITY * lowest_square(depth) / DEPTH**2 / 2 for depth in depths]
    draw(panels[2], "Kelvin-Voigt layer", depths, rates, exact)
    plain(panels[3], "degree of the harmonic", "frequency [1/s]")
    ball = sphere_atlas(1.0, texels // 2)
    degrees = list(range(1, 11))
    exact = [float(np.sqrt(degree * (degree + 1))) for degree in degrees]
    tones = [
        swung(ball, Material(), eval_legendre(degree, ball.positions[..., 2]), rough)[0]
        for degree, rough in zip(degrees, exact, strict=True)
    ]
    draw(panels[3], "sphere of 1 m", [float(degree) for degree in degrees], tones, exact)
    return save(figure, folder, "decay")


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Decay of waves, and modes of a sphere, against theory."
    )
    parser.add_argument(
        "--texels", type=int, default=96, help="along the side of the square; half on the sphere"
    )
    print(make(FOLDER, parser.parse_args().texels))


if __name__ == "__main__":
    main()
