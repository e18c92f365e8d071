"""Pages that play a run, made with the documentation: they would be large to keep beside it."""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

from ripple_sim import ExportOptions, export_scene, load_scene

# By scene: how much of it is played.
PLAYED = {
    scene: ExportOptions(fps=30, duration=duration, resolution=48)
    for scene, duration in {
        "sphere": 2.0,
        "pretzel": 2.0,
        "duck": 3.0,
        "jelly": 1.5,
        "arm": 2.0,
    }.items()
}
# The theme would frame what opens as a note, with a pencil beside the picture.
_STYLE = (
    "<style>details.player{border:0;box-shadow:none;padding:0;font-size:inherit}"
    "details.player>summary{padding:0;margin:0;background:none;cursor:pointer}"
    "details.player>summary::before,details.player>summary::after{display:none}</style>\n\n"
)
# A picture on a line of its own; those in tables stay pictures.
_PICTURE = re.compile(rf"^!\[([^\]]*)\]\(pictures/({'|'.join(PLAYED)})\.webp\)$", re.MULTILINE)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put a player where one is asked for, and behind the pictures of its scene, which open it."""
    for scene in PLAYED:
        markdown = markdown.replace(f"<!-- player: {scene} -->", _frame(scene))
    opening, count = _PICTURE.subn(
        lambda found: _opening(html.escape(found[1]), found[2]), markdown
    )
    return f"{opening}\n\n{_STYLE}" if count else markdown


def on_post_build(config: Any, **_: Any) -> None:
    """Make the pages."""
    folder = Path(config["site_dir"]) / "players"
    folder.mkdir(exist_ok=True)
    for scene, options in PLAYED.items():
        export_scene(load_scene(scene), folder / f"{scene}.html", options)


def _frame(scene: str) -> str:
    return (
        f'<iframe src="players/{scene}.html" title="{scene}" loading="lazy" allowfullscreen '
        'style="border: 0; width: 100%; aspect-ratio: 16 / 9"></iframe>'
    )


def _opening(text: str, scene: str) -> str:
    picture = f'<img src="pictures/{scene}.webp" alt="{text}" title="{text}: open the player">'
    return f"<details class='player'><summary>{picture}</summary>{_frame(scene)}</details>"
