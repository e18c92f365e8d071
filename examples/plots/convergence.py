"""Error over resolution: the sphere's mode Y_40 after one period, by each operator.

    python examples/plots/convergence.py

writes out/plots/convergence.png.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from figure import COLORS, FAINT, FOLDER, NAMES, TEXT, plain, save, sheet

from ripple_sim.bench import sphere_mode_error

LIFT = {"uncorrected": 9, "paper": -9}  # of the names that would touch [points]


def make(folder: Path, resolutions: Sequence[int] = (12, 16, 24, 32, 48, 64, 96, 128)) -> Path:
    figure = sheet(
        8.6,
        5.6,
        "Convergence",
        "unit sphere, mode Y40 after one period: relative L2 error of the height",
    )
    axes = figure.add_axes((0.105, 0.115, 0.66, 0.70))
    plain(axes, "texels along an edge of a face", "relative error")
    for operator, name in NAMES.items():
        errors = [sphere_mode_error(n, operator) for n in resolutions]
        color = COLORS[operator]
        order = -np.polyfit(np.log(resolutions), np.log(errors), 1)[0]
        axes.loglog(resolutions, errors, "o-", color=color, linewidth=1.8, markersize=4.5)
        axes.annotate(
            f"{name}\norder {abs(order):.2f}",
            (resolutions[-1], errors[-1]),
            xytext=(9, LIFT.get(operator, 0)),
            textcoords="offset points",
            fontsize=10,
            color=color if operator == "fem" else TEXT,
            va="center",
        )
        if operator == "fem":
            first = np.array(resolutions)
            slope = errors[0] * 0.45
            axes.loglog(first, slope * (first[0] / first) ** 2, "--", color=FAINT, linewidth=1.0)
            axes.text(
                first[1],
                slope * (first[0] / first[1]) ** 2 * 0.42,
                "second order",
                fontsize=9.5,
                color=FAINT,
            )
    axes.set_xticks(resolutions, [str(n) for n in resolutions])
    axes.set_xticks([], minor=True)
    return save(figure, folder, "convergence")


def main() -> None:
    print(make(FOLDER))


if __name__ == "__main__":
    main()
