"""Arrows of contacts: their length, what hides them, and that drawing stays inside the frame."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.overlay.marks import MEMORY, ContactMarks, Mark, Sprite, draw_arrow
from ripple_sim.overlay.panels import Layout, PlacedMark, Projection, draw_marks, place_marks
from ripple_sim.render import Camera
from ripple_sim.solver import sphere_atlas

SIZE = (640, 480)
LAYOUT = Layout(*SIZE)
EMPTY = '<mujoco><worldbody><geom size=".1" pos="0 0 -9"/>{}</worldbody></mujoco>'
FRONT = Projection(Camera((0, 0, 0), 5.0, 90.0, 0.0).pose(), *SIZE)


def state(body: str = "") -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(EMPTY.format(body))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def mark(
    impulse: float, axis: tuple[float, float, float] = (1, 0, 0), place: tuple = (0, 0, 0), **fields: float
) -> Mark:
    return Mark(np.array(place, float), np.array(axis, float), impulse, **fields)


@pytest.mark.parametrize(("impulse", "length"), [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (1.4, 1.4), (9.0, 1.5)])
@pytest.mark.parametrize("distance", [0.0, 40.0])
def test_an_arrow_across_the_view_is_as_long_as_its_impulse_at_any_distance(
    impulse: float, length: float, distance: float
) -> None:
    [placed] = place_marks([mark(2 * impulse, place=(0, distance, 0))], 2.0, LAYOUT, FRONT, *state())
    np.testing.assert_allclose(placed.tip, [320, 240], atol=1e-9)
    np.testing.assert_allclose(placed.tail, [320 + length * LAYOUT.arrow_length, 240], atol=1e-9)


def test_an_arrow_along_the_view_is_foreshortened_and_one_behind_the_camera_left_out() -> None:
    marks = [mark(1.0, axis=(0, -1, 0), place=(0.5, 0, 0)), mark(1.0, place=(0, -9, 0))]
    [placed] = place_marks(marks, 1.0, LAYOUT, FRONT, *state())
    assert np.linalg.norm(placed.tail - placed.tip) < 0.2 * LAYOUT.arrow_length


def test_hidden_parts_are_faint_and_fading_marks_fainter() -> None:
    box = '<geom type="box" size=".2 .1 1" pos=".2 -1 0"/>'
    reach = 0.4 / FRONT.metres(np.zeros(3)) / LAYOUT.arrow_length
    [placed] = place_marks([mark(reach, place=(0.2, 0, 0), opacity=0.5)], 1.0, LAYOUT, FRONT, *state(box))
    assert placed.opacity[0] == pytest.approx(0.15)
    assert placed.opacity[-1] == pytest.approx(0.5)
    assert set(np.round(placed.opacity, 9)) == {0.15, 0.5}


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("shift", [(0, 0), (-30, 20), (1000, 0), (0, -1000)])
def test_a_mark_over_the_border_is_the_one_on_a_larger_frame_cut(shift: tuple[int, int], channels: int) -> None:
    layout, opacity = Layout(1280, 720), np.ones(9)
    tip, tail = np.array([40.3, 30.6]), np.array([-20.0, 60.0])
    small, large = (np.full((*size, channels), 200, np.uint8) for size in ((60, 80), (3060, 3080)))
    draw_marks(small, [PlacedMark(tip + shift, tail + shift, opacity)], layout)
    draw_marks(large, [PlacedMark(tip + shift + 1500, tail + shift + 1500, opacity)], layout)
    np.testing.assert_allclose(small.astype(int), large[1500:1560, 1500:1580], atol=1)
    assert (small != 200).any() == (max(map(abs, shift)) < 1000)


class Still:
    """A sphere on a turned geom, touched as the test says."""

    def __init__(self) -> None:
        self.atlas = sphere_atlas(0.5, 8)
        self.turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
        waves = SimpleNamespace(atlas=self.atlas, height=np.zeros((6, 8, 8)), vertices=None)
        self.ripples = type("Named", (dict,), {"geom_ids": {"ball": 0}})(ball=waves)
        pose = {"geom_xpos": np.array([[1.0, 2.0, 3.0]]), "geom_xmat": self.turn.reshape(1, 9)}
        self.data = SimpleNamespace(model=SimpleNamespace(ngeom=1), **pose)
        self.impulses: list[Impulse] = []

    def touch(self, impulse: float, texel: tuple[int, int, int] = (0, 4, 4), other: str = "stone") -> Impulse:
        point = self.data.geom_xpos[0] + self.turn @ self.atlas.positions[texel]
        return Impulse("ball", other, point, impulse, texel)


def test_a_mark_stands_on_the_risen_surface_in_the_world() -> None:
    still = Still()
    still.impulses = [still.touch(2.0)]
    still.ripples["ball"].height[0, 4, 4] = 0.1
    [found] = ContactMarks(still, 1 / 60).follow()
    normal = still.turn @ still.atlas.normals[0, 4, 4]
    np.testing.assert_allclose(found.axis, normal)
    np.testing.assert_allclose(found.point, still.impulses[0].point + 0.1 * normal, atol=2e-3)
    assert (found.impulse, found.opacity) == (2.0, 1.0)


def test_a_mark_fades_with_its_memory_and_is_forgotten() -> None:
    still = Still()
    still.impulses = [still.touch(2.0)]
    marks = ContactMarks(still, MEMORY / 4)
    marks.follow()
    still.impulses = []
    seen = [marks.follow() for _ in range(12)]
    for number, found in enumerate(seen, 1):
        share = np.exp(-number / 4)
        assert len(found) == (share > 0.08)
        if found:
            assert found[0].impulse == pytest.approx(2.0 * share)
            assert found[0].opacity == pytest.approx(min(1.0, (share - 0.08) / (0.35 - 0.08)))


def test_contacts_in_one_place_add_up_and_others_are_apart_the_weakest_first() -> None:
    still = Still()
    still.impulses = [still.touch(1.0), still.touch(2.0), still.touch(0.0, (1, 4, 4)), still.touch(0.5, other="leaf")]
    still.impulses.append(still.touch(0.7, (3, 2, 2)))
    found = ContactMarks(still, 1 / 60).follow()
    assert [mark.impulse for mark in found] == pytest.approx([0.5, 0.7, 3.0])


def test_a_mark_is_the_whole_arrow_up_to_its_rim() -> None:
    layout, tip, tail, opacity = Layout(1280, 720), np.array([60.0, 40.0]), np.array([20.0, 40.0]), np.ones(9)
    frame, whole = (np.zeros((80, 90, 3), np.uint8) for _ in range(2))
    draw_marks(frame, [PlacedMark(tip, tail, opacity)], layout)
    sprite = Sprite(90, 80)
    draw_arrow(sprite, tip, tail, layout.arrow_thickness, opacity)
    sprite.over(whole, 0, 0)
    np.testing.assert_array_equal(frame, whole)
