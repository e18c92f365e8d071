"""Panels have sizes that follow the frame's; contact marks are where a camera sees them."""

import itertools
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from mujoco_models import posed

from ripple_sim import overlay
from ripple_sim.coupling import Energy, Impulse
from ripple_sim.overlay import Layout, Mark, Notes, Painter, Projection, Sprite
from ripple_sim.render import Camera
from ripple_sim.scene import NAMES, parse_request
from ripple_sim.solver import sphere_atlas

SIZES = [(320, 180), (640, 360), (720, 1280), (1280, 720), (3840, 2160)]
SCALE = 1.0, 1.0

# shares of the size of the type, above and below the line on which it stands
ASCENT = 0.75
DESCENT = 0.24

SIZE = (640, 480)
LAYOUT = Layout(*SIZE)
EMPTY = '<mujoco><worldbody><geom size=".1" pos="0 0 -9"/>{}</worldbody></mujoco>'
FRONT = Projection(Camera((0, 0, 0), 5.0, 90.0, 0.0).pose(), *SIZE)

CAMERA = Camera((0.1, -0.2, 0.3), 4.0, 37.0, -25.0, 50.0)
VEILED_BOX = """<mujoco><worldbody><geom type="box" size=".5 .5 .5"/>
<geom name="veil" type="box" size=".01 9 9" pos="2 0 0" group="{}"/></worldbody></mujoco>"""


class TextBox(NamedTuple):
    """The box of a text [pixels], and the sprite on which the text is written."""

    left: float
    top: float
    right: float
    bottom: float
    sprite: Sprite


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[TextBox]:
    """Boxes of all texts that are written."""
    boxes = []
    plain = Sprite.text

    def text(self: Sprite, x: float, y: float, text: str, size: int, *style: object) -> None:
        align = str(style[1]) if len(style) > 1 else "left"
        share_left_of_x = {"left": 0.0, "middle": 0.5, "right": 1.0}[align]
        width = overlay.text_width(text, size)
        left = x - share_left_of_x * width
        box = TextBox(left, y - ASCENT * size, left + width, y + DESCENT * size, self)
        boxes.append(box)
        plain(self, x, y, text, size, *style)

    monkeypatch.setattr(Sprite, "text", text)
    return boxes


@pytest.mark.parametrize("size", SIZES)
def test_the_ledger_overlaps_nothing_or_is_left_out(size: tuple[int, int], written: list) -> None:
    layout = Layout(*size)
    plain_plot = overlay.EnergyPlot(layout, 4.0, ledger=False)
    plot_with_ledger = overlay.EnergyPlot(layout, 4.0, ledger=True)
    curve = np.linspace(0, 3, 50), np.ones(50)
    plain_panel = plain_plot.draw([curve], 1.0, 1.0)
    written.clear()
    panel = plot_with_ledger.draw([curve], 1.0, 1.0, Energy(-1.234e-3, 8.88e-4))
    in_ledger = [box for box in written if box.sprite is panel]
    is_whole = len(in_ledger) == 6  # three names with a number each
    assert all(box.left >= 0 and box.right <= panel.width for box in written)
    assert (panel.height > plain_panel.height) is is_whole
    for one, other in itertools.pairwise(sorted(in_ledger, key=lambda box: box.left)):
        assert one.right < other.left
    if size == (1280, 720):
        assert len(in_ledger) == 6


@pytest.mark.parametrize("size", SIZES)
def test_panels_and_their_type_stay_inside_and_apart(size: tuple[int, int], written: list) -> None:
    layout = Layout(*size)
    times = np.linspace(0, 3, 200)
    taken = np.zeros(size[::-1], int)
    plot = overlay.EnergyPlot(layout, 4.0, ["ripple-sim", "Dynamic Paint"])
    panels = {
        "top left": overlay.label("t = 12.34 s", layout.em, "slow"),
        "top right": overlay.arrow_key(layout, 0.05, 0.05),
        "bottom left": overlay.color_bar(layout, "velocity", "m/s", 0.5, 0.5),
        "bottom right": plot.draw([(times, np.sin(times) ** 2)] * 2, 1.0, 1.0),
    }
    for corner, panel in panels.items():
        left, top = layout.place(corner, panel.width, panel.height)
        assert min(left, top) >= 0
        assert (np.array([left + panel.width, top + panel.height]) <= size).all()
        taken[top : top + panel.height, left : left + panel.width] += 1
    assert taken.max() == 1
    assert len(written) > 12
    for box in written:
        assert min(box.left, box.top) >= 0
        assert box.right <= box.sprite.width and box.bottom <= box.sprite.height
    assert layout.em >= 9


@pytest.mark.parametrize("size", [(320, 180), (1280, 720)])
def test_a_comparison_fits(size: tuple[int, int], written: list) -> None:
    layout = Layout(*size)
    width, _ = size
    titles = [overlay.TITLES["fem"], overlay.TITLES["dynamic-paint"]]
    painter = Painter(parse_request(NAMES[1:]), layout, duration=5.0, spacing=8, titles=titles)
    curve = np.linspace(0, 5, 9), np.ones(9)
    notes = Notes(1.0, [], SCALE, [], SCALE, [curve, curve], SCALE)
    panels = {corner: first for corner, (first, *_) in painter._panels(notes).items()}
    widest_side = max(panels["top left"].width, panels["top right"].width)
    assert widest_side + panels["top"].width / 2 < width / 2 - layout.margin
    assert panels["bottom left"].width + panels["bottom right"].width < width
    plot = panels["bottom right"]
    heading = [
        box for box in written if box.sprite.height == plot.height and box.bottom < 2 * layout.em
    ]
    # title, unit, and the names where there is room
    assert len(heading) == (2 if width < 400 else 4)
    for one, other in itertools.pairwise(sorted(heading, key=lambda box: (box.left, box.right))):
        assert one.right < other.left


@pytest.mark.parametrize("size", [(16, 16), (32, 400), (400, 32), (160, 90)])
def test_a_tiny_frame_has_no_panels(size: tuple[int, int]) -> None:
    frame = np.zeros((*size[::-1], 3), np.uint8)
    notes = Notes(1.0, [], SCALE, [], SCALE, [], SCALE)
    Painter(parse_request(["time"]), Layout(*size), duration=5.0).paint(frame, notes)
    assert not frame.any()


@pytest.mark.parametrize("size", SIZES)
def test_numbers_on_an_axis_do_not_touch(size: tuple[int, int], written: list) -> None:
    overlay.color_bar(Layout(*size), "height", "m", 0.0125, 0.0125)
    rows: dict[float, list[TextBox]] = {}
    for box in written:
        rows.setdefault(box.bottom, []).append(box)
    assert max(map(len, rows.values())) == 5
    for row in rows.values():
        for one, other in itertools.pairwise(sorted(row, key=lambda box: (box.left, box.right))):
            assert one.right < other.left


def test_bar_has_the_colors_of_its_values() -> None:
    layout = Layout(1280, 720)
    bar = overlay.color_bar(layout, "height", "m", 0.02, 0.02)
    frame = np.zeros((bar.height, bar.width, 3), np.uint8)
    bar.over(frame, 0, 0)
    row = frame[round(2.25 * layout.em)].astype(int)
    for value in (-0.02, -0.01, 0.0, 0.005, 0.0199):
        difference = np.abs(row - overlay.colors(value, 0.02).astype(int)).max(axis=1)
        assert difference.min() <= 2  # codes of 255, between neighbouring pixels
    from_middle_colour = np.abs(row - overlay.colors(0.0, 0.02).astype(int)).sum(axis=1)
    middle = int(np.argmin(from_middle_colour))
    assert abs(middle - bar.width / 2) < 3


def placed(marks: list[Mark], body: str = "", largest: float = 1.0) -> list:
    return overlay.place_marks(marks, largest, LAYOUT, FRONT, *posed(EMPTY.format(body)))


def mark(
    impulse: float, axis: tuple = (1, 0, 0), place: tuple = (0, 0, 0), **fields: float
) -> Mark:
    return Mark(np.array(place, float), np.array(axis, float), impulse, **fields)


@pytest.mark.parametrize(
    ("impulse", "length"), [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (1.4, 1.4), (9.0, 1.5)]
)
@pytest.mark.parametrize("distance", [0.0, 40.0])
def test_an_arrow_is_as_long_as_its_impulse_at_any_distance(
    impulse: float, length: float, distance: float
) -> None:
    [(tip, tail, _)] = placed([mark(2 * impulse, place=(0, distance, 0))], largest=2.0)
    np.testing.assert_allclose(tip, [320, 240], atol=1e-9)
    np.testing.assert_allclose(tail, [320 + length * LAYOUT.arrow_length, 240], atol=1e-9)


def test_an_arrow_along_the_view_is_foreshortened_and_one_behind_the_camera_left_out() -> None:
    marks = [mark(1.0, axis=(0, -1, 0), place=(0.5, 0, 0)), mark(1.0, place=(0, -9, 0))]
    [(tip, tail, _)] = placed(marks)
    assert np.linalg.norm(tail - tip) < 0.2 * LAYOUT.arrow_length


def test_hidden_parts_are_faint_and_fading_marks_fainter() -> None:
    box = '<geom type="box" size=".2 .1 1" pos=".2 -1 0"/>'
    reach = 0.4 / FRONT.metres(np.zeros(3)) / LAYOUT.arrow_length
    [(_, _, opacity)] = placed([mark(reach, place=(0.2, 0, 0), opacity=0.5)], box)
    assert opacity[[0, -1]] == pytest.approx([0.15, 0.5])
    assert set(np.round(opacity, 9)) == {0.15, 0.5}


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("shift", [(0, 0), (-30, 20), (1000, 0), (0, -1000)])
def test_a_mark_over_the_border_is_cut_off(shift: tuple[int, int], channels: int) -> None:
    layout = Layout(1280, 720)
    opacity = np.ones(9)
    tip = np.array([40.3, 30.6])
    tail = np.array([-20.0, 60.0])
    border = 1500  # [pixels] of the larger frame, around the smaller one
    small = np.full((60, 80, channels), 200, np.uint8)
    large = np.full((60 + 2 * border, 80 + 2 * border, channels), 200, np.uint8)
    overlay.draw_marks(small, [(tip + shift, tail + shift, opacity)], layout)
    moved = np.array(shift) + border
    overlay.draw_marks(large, [(tip + moved, tail + moved, opacity)], layout)
    cut_out = large[border : border + 60, border : border + 80]
    np.testing.assert_allclose(small.astype(int), cut_out, atol=1)  # round-off of a code
    is_inside = max(map(abs, shift)) < 1000
    assert (small != 200).any() == is_inside


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

    def touch(
        self, impulse: float, texel: tuple[int, int, int] = (0, 4, 4), other: str = "stone"
    ) -> Impulse:
        point = self.data.geom_xpos[0] + self.turn @ self.atlas.positions[texel]
        return Impulse("ball", other, point, impulse, texel)


def test_a_mark_stands_on_the_risen_surface_in_the_world() -> None:
    still = Still()
    still.impulses = [still.touch(2.0)]
    still.ripples["ball"].height[0, 4, 4] = 0.1
    [found] = overlay.ContactMarks(still, 1 / 60).follow()
    normal = still.turn @ still.atlas.normals[0, 4, 4]
    np.testing.assert_allclose(found.axis, normal)
    np.testing.assert_allclose(found.point, still.impulses[0].point + 0.1 * normal, atol=2e-3)
    assert (found.impulse, found.opacity) == (2.0, 1.0)


def test_contacts_in_one_place_add_up_and_marks_are_sorted_by_impulse() -> None:
    still = Still()
    still.impulses = [
        still.touch(1.0),
        still.touch(2.0),
        still.touch(0.0, (1, 4, 4)),
        still.touch(0.5, other="leaf"),
    ]
    still.impulses.append(still.touch(0.7, (3, 2, 2)))
    found = overlay.ContactMarks(still, 1 / 60).follow()
    assert [mark.impulse for mark in found] == pytest.approx([0.5, 0.7, 3.0])


@pytest.mark.parametrize("size", [(640, 480), (480, 640), (33, 17)])
def test_points_ahead_project_to_their_pixel_and_points_behind_to_none(
    size: tuple[int, int],
) -> None:
    pose = CAMERA.pose()
    projection = Projection(pose, *size)
    width, height = size
    half_height = np.tan(np.radians(pose.fovy) / 2)  # at a distance of 1
    distances = np.array([[0.1], [3.0], [400.0]])  # [m]
    for pixel in np.random.default_rng(0).uniform(0, size, (20, 2)):
        # from the angle of view alone
        column, row = pixel
        x = (2 * column / width - 1) * half_height * width / height
        y = (1 - 2 * row / height) * half_height
        points = pose.position + distances * (pose.rotation @ [x, y, -1.0])
        np.testing.assert_allclose(projection.pixels(points), np.tile(pixel, (3, 1)), rtol=1e-9)
    backwards = pose.rotation[:, 2]
    behind_beside_ahead = pose.position + np.array([[1.0], [0.0], [-1.0]]) * backwards
    np.testing.assert_array_equal(
        np.isnan(projection.pixels(behind_beside_ahead)).all(axis=1), [True, True, False]
    )


@pytest.mark.parametrize(("group", "seen"), [(0, False), (2, False), (3, True)])
def test_geoms_of_hidden_groups_hide_nothing(group: int, seen: bool) -> None:
    model, data = posed(VEILED_BOX.format(group))
    pose = Camera((0, 0, 0), 5.0, 180.0, 0.0).pose()  # at x = 5, looks along -x
    np.testing.assert_allclose(pose.position, [5, 0, 0], atol=1e-12)
    points = np.array([[0.5, 0.1, 0.2], [0.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    found = Projection(pose, 64, 48).seen(model, data, points)
    np.testing.assert_array_equal(found, [seen, False, False, True])
