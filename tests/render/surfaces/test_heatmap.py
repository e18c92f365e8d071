"""Heatmaps: what they refuse."""

import mujoco
import numpy as np
import pytest
from drawn import ball_surface

from ripple_sim.render import Renderer, Surface
from ripple_sim.solver import RippleError

COLORS = np.arange(9, dtype=np.uint8).reshape(3, 3)


def test_what_is_no_heatmap_is_refused(gl) -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='.5'/><geom size='.1'/></worldbody></mujoco>")
    plain = ball_surface("clay")
    mapped = Surface(plain.V, plain.F, plain.charts, heatmap_colors=COLORS)
    halo = np.zeros((6, plain.charts.page.block, plain.charts.page.block), np.float32)
    with Renderer(gl, model, {0: mapped}, size=(32, 24)) as renderer:
        renderer.set_heatmap(0, halo, 1.0)
        with pytest.raises(RippleError, match=r"shape \[6, 8, 8\]; valid is \[6, 10, 10\]"):
            renderer.set_heatmap(0, halo[:, 1:-1, 1:-1], 1.0)
        with pytest.raises(RippleError, match=r"limit is 0\.0"):
            renderer.set_heatmap(0, halo, 0.0)
        with pytest.raises(RippleError, match="geom 1 is no target; the targets' geoms are: 0"):
            renderer.set_heatmap(1, halo, 1.0)
    with Renderer(gl, model, {0: plain}, size=(32, 24)) as renderer, pytest.raises(RippleError, match="has no heatmap"):
        renderer.set_heatmap(0, halo, 1.0)
