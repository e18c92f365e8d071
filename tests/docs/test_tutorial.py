"""The last clip of the tutorial shows rings, as its text promises."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.capture import FrameSource, snapshots
from ripple_sim.scene import load_scene
from ripple_sim.scenes.shapes import peanut, write_obj
from ripple_sim.simulation import Simulation

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial.md"

# After the hit, when the body has left; a tenth of a second is a frame.
FRAMES = (6, 7, 8, 9, 10, 12)


@pytest.mark.filterwarnings("error")
def test_rings_of_the_last_clip_change_900_pixels_of_640_by_360_without_a_warning(
    opengl: None, tmp_path: Path
) -> None:
    """A pixel changes if it differs by 10 of 255 or more from that of a flat surface."""
    blocks = re.findall(r"```(\w+)(?: title=\"[^\"]+\")?\n(.*?)```", TUTORIAL.read_text(), re.S)
    write_obj(tmp_path / "my_mesh.obj", *peanut())
    model = next(text for language, text in blocks if language == "xml")
    (tmp_path / "my_scene.xml").write_text(model)
    scene = "\n".join(text for language, text in blocks if language == "toml")
    (tmp_path / "my_scene.toml").write_text(scene)
    simulation = Simulation(load_scene(tmp_path / "my_scene.toml"), fps=10, backend="cpu")
    source = FrameSource(simulation, width=640, height=360)
    for snapshot in snapshots(simulation, FRAMES[-1] + 1):
        if snapshot.number not in FRAMES:
            continue
        height_maps = {name: 0 * heights for name, heights in snapshot.height_maps.items()}
        flat = dataclasses.replace(snapshot, height_maps=height_maps)
        change = np.abs(source.render(snapshot).astype(int) - source.render(flat)).max(axis=-1)
        assert (change >= 10).sum() >= 900
