"""Figure 2: an object and its sphere map.

python examples/paper/figure_2.py
"""

from pathlib import Path

from page import Part

from ripple_sim import plot_atlas
from ripple_sim.scenes.shapes import LIMBED_FILE
from ripple_sim.solver import build_atlas, load_mesh

RESOLUTION = 96


def make(folder: Path) -> Part:
    mesh = load_mesh(LIMBED_FILE)
    pictures = []
    rows = [["sphere map", "folds", "widest 0.1 % of the area", "starved area", "covered"]]
    for method, words in (("conformal", "as in the paper"), ("progressive", "ours")):
        atlas = build_atlas(mesh, RESOLUTION, method=method, layout="cube")
        file = folder / f"figure_2_{method}.png"
        plot_atlas(
            atlas,
            file,
            title=f"{method}, {words}",
            subtitle=f"6 x {RESOLUTION} x {RESOLUTION} texels",
            up="z",
        )
        figures = atlas.quality()
        pictures.append(
            (
                file,
                (
                    f"{method.capitalize()}: blue texels are smaller than in an even spread, red "
                    "texels larger."
                ),
            )
        )
        rows.append(
            [
                f"{method} ({words})",
                f"{figures['flipped']:.0f}",
                f"{figures['q999']:.1f} times an even spread",
                f"{100 * figures['starved']:.1f} %",
                f"{100 * figures['coverage']:.1f} %",
            ]
        )
    return Part(
        "Figure 2: an object and its sphere map",
        "A conformal map preserves angles but gives the legs almost no area on the sphere. They "
        "get few texels, and waves die there. The progressive map spreads the texels evenly, "
        "without folds.",
        pictures,
        rows,
    )


if __name__ == "__main__":
    from run import alone

    alone(make)
