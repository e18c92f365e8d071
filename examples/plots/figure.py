"""How the plots look: one sheet, its title, its axes, and where it is written."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure  # without pyplot, which would look for a display

TEXT, FAINT, HAIR = "#1b2432", "#6b7685", "#cfd5dd"
FOLDER = Path("out/plots")

# one colour for each wave operator in all plots, told apart with every colour vision
COLORS = {
    "fem": "#1f5fa8",
    "paper": "#d1632f",
    "uncorrected": "#a9a33c",
    "dynamic-paint": "#7a7f89",
}
NAMES = {
    "fem": "ripple-sim",
    "paper": "the paper's operator",
    "uncorrected": "uncorrected",
    "dynamic-paint": "Dynamic Paint's",
}


def sheet(width: float, height: float, title: str, subtitle: str) -> Figure:
    """An empty figure [inches] with a title."""
    figure = Figure(figsize=(width, height), dpi=120, facecolor="white")
    figure.text(
        0.35 / width,
        1 - 0.42 / height,
        title,
        fontsize=17,
        fontweight="bold",
        color=TEXT,
        va="center",
    )
    figure.text(0.35 / width, 1 - 0.76 / height, subtitle, fontsize=10.5, color=FAINT, va="center")
    return figure


def plain(axes: Axes, x: str, y: str) -> None:
    """Dress axes: two spines, a faint grid, names."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)
    axes.grid(color=HAIR, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(colors=TEXT, labelsize=9.5, width=0.6)
    axes.set_xlabel(x, fontsize=10.5, color=TEXT)
    axes.set_ylabel(y, fontsize=10.5, color=TEXT)


def save(figure: Figure, folder: Path, name: str) -> Path:
    """Write a PNG and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.png"
    figure.savefig(path)
    return path
