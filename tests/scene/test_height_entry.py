"""Surfaces that begin with a shape: an expression of position, an image, a saved field."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ripple_sim import RippleError
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.simulation import Simulation

MJCF = """<mujoco><worldbody><body pos="3 0 0" euler="0 0 90">
<geom name="egg" type="sphere" size="0.5" pos="0 2 0" euler="0 90 0"/></body></worldbody></mujoco>"""
TOML = """model = "egg.xml"
[[ripple]]
geom = "egg"
resolution = 8
material = {density = 10.0}
"""


def simulated(folder: Path, height: str) -> Simulation:
    (folder / "egg.xml").write_text(MJCF)
    (folder / "egg.toml").write_text(TOML + f"[ripple.height]\n{height}\n")
    return Simulation(load_scene(folder / "egg.toml"), backend="cpu")


def test_an_expression_is_of_the_position_in_the_frame_of_the_body(tmp_path: Path) -> None:
    simulation = simulated(tmp_path, "expression = '0.01 * (x - 2*z) * (y - 2)'")
    waves = simulation.ripples["egg"]
    # the geom's frame is turned about the body's y, and moved along it
    x, y, z = np.moveaxis(waves.atlas.positions, -1, 0)
    np.testing.assert_allclose(waves.height, 0.01 * (z + 2 * x) * y, atol=1e-6)


def test_a_reset_brings_the_shape_back_and_a_saved_field_begins_where_it_was(tmp_path: Path) -> None:
    simulation = simulated(tmp_path, "expression = '0.01 * x'")
    begun = simulation.ripples["egg"].height
    for _ in range(20):
        simulation.advance_frame()
    moved = simulation.ripples["egg"].height
    assert np.abs(moved - begun).max() > 1e-4
    np.save(tmp_path / "moved.npy", moved)
    simulation.reset()
    np.testing.assert_array_equal(simulation.ripples["egg"].height, begun)
    np.testing.assert_allclose(simulated(tmp_path, "field = 'moved.npy'").ripples["egg"].height, moved, atol=1e-8)


def test_an_image_is_taken_in_the_mesh_s_own_coordinates(tmp_path: Path) -> None:
    # a flat pyramid, whose texture coordinates are x and y
    V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.2]])
    lines = [f"v {x} {y} {z}\nvt {x} {y}" for x, y, z in V]
    lines += [f"f {a}/{a} {b}/{b} 5/5" for a, b in ((1, 2), (2, 3), (3, 4), (4, 1))]
    (tmp_path / "square.obj").write_text("\n".join(lines))
    Image.fromarray(np.repeat(np.arange(2, 256, 4, dtype=np.uint8)[None], 4, axis=0)).save(tmp_path / "ramp.png")
    (tmp_path / "square.xml").write_text(
        "<mujoco><asset><mesh name='m' file='square.obj' inertia='shell'/></asset><worldbody>"
        "<geom name='egg' type='mesh' mesh='m'/></worldbody></mujoco>"
    )
    heights = []
    for shape in ("map = 'ramp.png'\nlow = -0.01\nhigh = 0.01", "expression = '0.02 * x'"):
        (tmp_path / "square.toml").write_text(TOML.replace("egg.xml", "square.xml") + f"[ripple.height]\n{shape}\n")
        heights.append(Simulation(load_scene(tmp_path / "square.toml"), backend="cpu").ripples["egg"].height)
    # the image repeats, so that its two ends meet within a pixel of the sides
    assert np.quantile(np.abs(heights[0] - heights[1]), 0.9) < 1e-4
    assert np.ptp(heights[1]) > 0.019


@pytest.mark.parametrize(
    ("height", "message"),
    [
        ("", "has no shape; valid is one of expression, map, field"),
        ("expression = 'x'\nmap = 'a.png'", "has expression and map; valid is one"),
        ("expression = 'w'", "is unknown; valid are numbers, pi, x, y, z"),
        ("map = 'absent.png'", "which does not exist"),
        ("field = 'small.npy'", r"holds \(2, 2\); valid are numbers \(6, 8, 8\)"),
        ("field = 'endless.npy'", "not finite"),
        ("field = 'egg.xml'", "cannot be read"),
        ("expression = '1/(x-x)'", "not finite everywhere"),
    ],
    ids=["none", "two", "name", "absent", "small", "endless", "no-array", "infinite"],
)
def test_senseless_shapes_are_refused(tmp_path: Path, height: str, message: str) -> None:
    np.save(tmp_path / "small.npy", np.zeros((2, 2)))
    np.save(tmp_path / "endless.npy", np.full((6, 8, 8), np.nan))
    with pytest.raises(RippleError, match=message):
        simulated(tmp_path, height)
