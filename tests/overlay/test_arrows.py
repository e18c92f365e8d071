"""Arrows."""

import numpy as np

from ripple_sim.overlay.marks import Sprite, draw_arrow


def test_arrow_has_its_length_and_fades() -> None:
    sprite = Sprite(120, 60)
    draw_arrow(sprite, (100.0, 30.0), (20.0, 30.0), 4.0, [1.0, 1.0, 0.0, 0.0])
    frame = np.full((60, 120, 3), 255, np.uint8)
    sprite.over(frame, 0, 0)
    dark = 255 - frame[30, :, 0].astype(int)
    assert dark[100] > 200  # the tip's dot
    assert dark[70:95].min() > 200
    assert dark[20:40].max() == 0  # towards the tail nothing is seen
    assert dark[110:].max() == 0
