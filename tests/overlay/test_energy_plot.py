"""The plot of energy over time."""

import numpy as np
import pytest

from ripple_sim.overlay.painter import EnergyPlot
from ripple_sim.overlay.panels import Layout


def test_energy_plot_draws_values_at_their_height() -> None:
    layout = Layout(1280, 720)
    plot = EnergyPlot(layout, "energy", "J", 10.0)
    times = np.linspace(0, 10, 300)

    def row_of(value: float) -> float:
        frame = np.full((400, 400, 3), 255, np.uint8)
        plot.draw([(times, np.full(300, value))], 2.0, 2.0).over(frame, 0, 0)
        blue = (frame[..., 2].astype(int) - frame[..., 0]) > 80
        return float(np.flatnonzero(blue[:, 200]).mean())

    low, middle, high = row_of(0.5), row_of(1.0), row_of(1.5)
    assert low > middle > high
    assert low - middle == pytest.approx(middle - high, abs=1.0)


def test_energy_plot_grows_with_time() -> None:
    layout = Layout(1280, 720)
    plot = EnergyPlot(layout, "energy", "J", 10.0)

    def reach(until: float) -> int:
        times = np.linspace(0, until, 50)
        frame = np.full((400, 400, 3), 255, np.uint8)
        plot.draw([(times, np.ones(50))], 2.0, 2.0).over(frame, 0, 0)
        blue = (frame[..., 2].astype(int) - frame[..., 0]) > 80
        return int(np.flatnonzero(blue.any(axis=0)).max())

    quarter, half, whole = reach(2.5), reach(5.0), reach(10.0)
    assert half - quarter == pytest.approx((whole - quarter) / 3, abs=1.5)
