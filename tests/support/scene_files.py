"""Scene files of tests."""

from pathlib import Path


def write_scene(folder: Path, model: str, table: str) -> Path:
    """Path of a scene file in a folder; its model, "scene.xml", lies beside it."""
    (folder / "scene.xml").write_text(model)
    (folder / "scene.toml").write_text(table)
    return folder / "scene.toml"
