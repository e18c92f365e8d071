"""Pages that play a run, made with the documentation: they would be large to keep beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ripple_sim import ExportOptions, export_scene, load_scene

# By scene: how much of it is played.
PLAYED = {
    "sphere": ExportOptions(fps=30, duration=2.0, resolution=48),
    "pretzel": ExportOptions(fps=30, duration=2.0, resolution=48),
}


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put a frame with its page where a player is asked for."""
    for scene in PLAYED:
        frame = (
            f'<iframe src="players/{scene}.html" title="{scene}" loading="lazy" allowfullscreen '
            'style="border: 0; width: 100%; aspect-ratio: 16 / 9"></iframe>'
        )
        markdown = markdown.replace(f"<!-- player: {scene} -->", frame)
    return markdown


def on_post_build(config: Any, **_: Any) -> None:
    """Make the pages."""
    folder = Path(config["site_dir"]) / "players"
    folder.mkdir(exist_ok=True)
    for scene, options in PLAYED.items():
        export_scene(load_scene(scene), folder / f"{scene}.html", options)
