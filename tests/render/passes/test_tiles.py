"""Tiles cover boxes, once and little more."""

import numpy as np

from ripple_sim.render.passes.deferred import Tiles

SIZE = (200, 120)


class Buffer:
    """Stands for a buffer on the GPU."""

    def write(self, data: bytes) -> None:
        self.corners = np.frombuffer(data, dtype="f4").reshape(-1, 2)


class Context:
    """Makes buffers."""

    def buffer(self, **_: object) -> Buffer:
        return Buffer()


def test_tiles_cover_the_boxes_once_and_little_more() -> None:
    tiles = Tiles(Context(), SIZE)
    boxes = np.array([[10, 20, 60, 50], [40, 40, 64, 64], [150, 100, 200, 120], [70, 70, 70, 70]])
    tiles.cover(boxes)
    shown = np.zeros(SIZE[::-1], dtype=int)
    wanted = np.zeros(SIZE[::-1], dtype=bool)
    for corner in tiles.buffer.corners[: tiles.count]:
        left, lower = np.round((corner + 1) / 2 * SIZE).astype(int)
        right, upper = np.round((corner + tiles.extent + 1) / 2 * SIZE).astype(int)
        shown[lower:upper, left:right] += 1
    for left, lower, right, upper in boxes:
        wanted[lower:upper, left:right] = True
    assert shown.max() == 1
    assert (shown[wanted] == 1).all()
    assert tiles.count == 7


def test_no_tiles_without_boxes() -> None:
    tiles = Tiles(Context(), SIZE)
    tiles.cover(np.zeros((0, 4), dtype=np.int64))
    assert tiles.count == 0
