"""Which way is up in a mesh file."""

from pathlib import Path

UP_AXES = ("y", "z")


def usual_up(path: str | Path) -> str:
    """Axis that usually points up in files of this format: "z" for STL, else "y"."""
    return "z" if Path(path).suffix.lower() == ".stl" else "y"
