"""Which way is up depends on the format of the file alone."""

from pathlib import Path

import pytest

from ripple_sim.scene.drop import UP_AXES, usual_up


@pytest.mark.parametrize(
    ("name", "up"),
    [("a.stl", "z"), ("A.STL", "z"), ("a.stl.obj", "y"), ("a.glb", "y"), ("stl", "y"), ("b.stl/a.ply", "y")],
)
def test_printers_files_stand_on_z_and_others_on_y(name: str, up: str) -> None:
    assert usual_up(name) == usual_up(Path("there") / name) == up
    assert up in UP_AXES
