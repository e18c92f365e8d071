"""How a large floor is drawn. The plotter of these tests records its calls."""

from types import SimpleNamespace

import numpy as np
import pytest
from mujoco_models import posed

from ripple_sim.overlay.scales import round_up
from ripple_sim.viewer import BACKGROUND, add_floor, is_endless
from ripple_sim.viewer.stage import _STEPS


@pytest.mark.parametrize("size", ["0 0", "6 6", "0 6", "6 4", "1 1"])
def test_a_plane_beyond_the_view_is_endless(size: str) -> None:
    plane = f'<geom type="plane" size="{size} 1"/>'
    model, _ = posed(
        f'<mujoco><worldbody>{plane}<geom type="box" size="9 9 9"/></worldbody></mujoco>'
    )
    assert is_endless(model, 0, 10.0) is (size in ("0 0", "6 6", "0 6"))
    assert not is_endless(model, 1, 10.0)


def test_a_large_floor_fades_from_its_colour_to_the_background() -> None:
    plotter = SimpleNamespace(add_mesh=lambda mesh, **style: mesh)
    color = np.array([0.2, 0.4, 0.6, 1.0])
    middle = np.array([3.0, -2.0, 7.0])
    disc = add_floor(plotter, middle, 5.0, color)
    away = np.linalg.norm(disc.points[:, :2] - middle[:2], axis=1)
    assert away.max() == pytest.approx(5.0, rel=1e-3)
    np.testing.assert_array_equal(disc.points[:, 2], 0)
    shown = disc.point_data["color"] / 255
    np.testing.assert_allclose(
        shown[away < 0.4], np.tile(color[:3], (int((away < 0.4).sum()), 1)), atol=2e-3
    )
    np.testing.assert_allclose(
        shown[away > 4.5], np.tile(BACKGROUND, (int((away > 4.5).sum()), 1)), atol=2e-3
    )
    order = np.argsort(away)
    assert (np.diff(shown[order, 0]) >= -1e-6).all()


@pytest.mark.parametrize(
    ("value", "limit"), [(1.0, 1), (1.01, 2), (2.0, 2), (3e-4, 5e-4), (5.1e-3, 1e-2), (70, 100)]
)
def test_a_limit_is_rounded_up_to_one_two_or_five(value: float, limit: float) -> None:
    assert round_up(value, _STEPS) == pytest.approx(limit)
    assert round_up(round_up(value, _STEPS), _STEPS) == pytest.approx(limit)
