"""Figures with a title and images, and the files that they are written to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure  # without pyplot, which would look for a display
from numpy.typing import NDArray

from ripple_sim.encode.replace import MARK, made_here
from ripple_sim.solver import AtlasError
from ripple_sim.solver.files import atomic_write, final_path

_ENDINGS = (".png", ".jpg", ".pdf", ".svg")

# Size of a figure [inches], and its pixels an inch.
_SIZE = (16, 9)
_DPI = 120

# Colours of text, and of text that says less.
TEXT = "#1b2432"
FAINT = "#6b7685"


def check_plot_path(path: str | Path, overwrite: bool = True) -> None:
    """Check that a figure can be written.

    Raises `AtlasError` if the ending is unknown, the folder is missing, or a file that was not made
    by ripple-sim would be replaced without `overwrite`.
    """
    path = Path(path)
    if path.suffix.lower() not in _ENDINGS:
        raise AtlasError(
            f"plot file {str(path)!r} has an unknown ending: it must end in {', '.join(_ENDINGS)}"
        )
    if not path.absolute().parent.is_dir() or path.is_dir():
        raise AtlasError(
            f"plot file {str(path)!r} cannot be written: name a file in a folder that exists"
        )
    try:
        final = final_path(path)
    except OSError as error:
        raise AtlasError(
            f"plot file {str(path)!r} cannot be written: {error.strerror}; name another file"
        ) from error
    if final.exists() and not (overwrite or made_here(final)):
        raise AtlasError(
            f"plot file {str(path)!r} cannot be written: it exists and was not {MARK}; name "
            "another file, or add --overwrite"
        )


def dressed(title: str, subtitle: str) -> Figure:
    """An empty figure with a title."""
    figure = Figure(figsize=_SIZE, dpi=_DPI, facecolor="white")
    figure.text(0.03, 0.945, title, fontsize=25, fontweight="bold", color=TEXT, va="center")
    figure.text(0.03, 0.903, subtitle, fontsize=12.5, color=FAINT, va="center")
    return figure


def show(
    figure: Figure, place: tuple[float, float, float, float], image: NDArray, caption: str = ""
) -> None:
    """Put an image into a figure, at left, bottom, width and height as shares of the figure."""
    axes = figure.add_axes(place)
    axes.imshow(image, interpolation="antialiased")
    axes.set_axis_off()
    if caption:
        axes.text(
            0.5,
            -0.03,
            caption,
            transform=axes.transAxes,
            ha="center",
            va="top",
            fontsize=11.5,
            color=FAINT,
        )


def save_plot(figure: Figure, path: str | Path) -> None:
    """Write a figure, with the mark that ripple-sim made it, whole or not at all.

    Raises `AtlasError` if that fails.
    """
    ending = Path(path).suffix.lower()
    try:
        with atomic_write(Path(path)) as unfinished:
            figure.savefig(unfinished, format=ending[1:], dpi=_DPI, **_mark_options(ending))
    except OSError as error:
        raise AtlasError(
            f"plot file {str(path)!r} cannot be written: {error.strerror or error}"
        ) from error


def _mark_options(ending: str) -> dict[str, Any]:
    """Options of `savefig` that write into a file that ripple-sim made it."""
    if ending == ".png":
        return {"metadata": {"Software": MARK}}
    if ending == ".jpg":
        return {"pil_kwargs": {"comment": MARK.encode()}}
    if ending == ".svg":
        return {"metadata": {"Creator": MARK, "Date": None}}  # the same figure, the same file
    return {"metadata": {"Creator": MARK}}
