"""Live pages in the documentation, made with it: they would be large to keep beside it."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Any

from ripple_sim import ExportOptions, drop_scene, export_scene, load_scene
from ripple_sim.scenes.shapes import peanut, write_obj

# By scene: how much of it is recorded [s].
_DURATIONS = {
    "sphere": 2.0,
    "pretzel": 2.0,
    "duck": 5.0,
    "teapot": 2.5,
    "drum": 2.0,
    "terrain": 2.5,
    "jelly": 1.5,
    "arm": 2.0,
}
_RESOLUTION = 48
_FPS = 30

# The mesh of the tutorial, with bodies that rain on it, and how much of that [s].
_TUTORIAL = "my_mesh"
_TUTORIAL_DURATION = 3.0

_PLAYED = (*_DURATIONS, _TUTORIAL)

# A picture on a line of its own; those in tables stay pictures.
_PICTURE = re.compile(rf"^!\[([^\]]*)\]\(pictures/({'|'.join(_PLAYED)})\.webp\)$", re.MULTILINE)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put a live page where one is asked for, and in place of the pictures of its scene."""
    shown = set()
    for scene in _PLAYED:
        mark = f"<!-- player: {scene} -->"
        if mark in markdown:
            shown.add(scene)
        markdown = markdown.replace(mark, _frame(scene))

    def live(found: re.Match[str]) -> str:
        # a page has each object once
        return "" if found[2] in shown else _frame(found[2])

    return _PICTURE.sub(live, markdown)


def on_post_build(config: Any, **_: Any) -> None:
    """Make the pages."""
    folder = Path(config["site_dir"]) / "players"
    folder.mkdir(exist_ok=True)
    for scene, duration in _DURATIONS.items():
        options = ExportOptions(fps=_FPS, duration=duration, resolution=_RESOLUTION)
        export_scene(load_scene(scene), folder / f"{scene}.html", options)
    with tempfile.TemporaryDirectory() as meshes:
        mesh = Path(meshes) / f"{_TUTORIAL}.obj"
        write_obj(mesh, *peanut())
        options = ExportOptions(fps=_FPS, duration=_TUTORIAL_DURATION, resolution=_RESOLUTION)
        export_scene(drop_scene(mesh), folder / f"{_TUTORIAL}.html", options)


def _frame(scene: str) -> str:
    """A page within the page; the browser loads it when it comes into view."""
    return (
        f'<iframe src="players/{scene}.html" title="{scene}: click or touch it to poke it" '
        'loading="lazy" allowfullscreen '
        'style="border: 0; width: 100%; aspect-ratio: 16 / 9; min-height: 15rem"></iframe>'
    )
