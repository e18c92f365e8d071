"""The limit on drawn heights: small waves pass unchanged, large ones smoothly bent, none beyond the limit."""

import numpy as np
import pytest

from ripple_sim.solver import HeightMap, sphere_atlas
from ripple_sim.solver.waves.height_map import FREE, MOST, DisplacementLimit

ATLAS = sphere_atlas(2.0, 12)
SHAPE = ATLAS.areas.shape


def drawn(height: float) -> float:
    return float(DisplacementLimit(ATLAS)(np.full(SHAPE, height, np.float32))[0, 6, 6])


def test_heights_up_to_a_quarter_of_the_radius_are_drawn_as_they_are() -> None:
    height = np.random.default_rng(0).uniform(-0.49, 0.49, SHAPE).astype(np.float32)
    assert DisplacementLimit(ATLAS)(height) is height
    assert FREE * 2.0 == 0.5


@pytest.mark.parametrize("sign", [-1, 1])
def test_beyond_it_the_drawn_height_grows_smoothly_towards_the_limit(sign: int) -> None:
    limit = DisplacementLimit(ATLAS)
    heights = np.linspace(0.3, 8.0, 800)
    seen = np.array([sign * limit(np.full(SHAPE, sign * h, np.float32))[0, 6, 6] for h in heights])
    assert (np.diff(seen)[:300] > 0).all() and (np.diff(seen) >= 0).all()
    assert seen.max() <= MOST * 2.0 * (1 + 1e-3)
    # slope and curvature have no jump where the bend begins
    slope = np.gradient(seen, heights)
    assert slope.max() <= 1.001
    assert np.abs(np.diff(slope)).max() < 0.02


@pytest.mark.parametrize("height", [1e6, -1e30, np.finfo(np.float32).max])
def test_no_height_is_too_large(height: float) -> None:
    assert abs(drawn(height)) == pytest.approx(MOST * 2.0, rel=1e-3)
    assert np.sign(drawn(height)) == np.sign(height)


def test_the_limit_is_the_same_at_every_scale() -> None:
    field = np.random.default_rng(1).standard_normal(SHAPE)
    shares = [DisplacementLimit(sphere_atlas(r, 12))((r * field).astype(np.float32)) / r for r in (1e-3, 1.0, 1e3)]
    np.testing.assert_allclose(shares[0], shares[1], rtol=1e-4)
    np.testing.assert_allclose(shares[2], shares[1], rtol=1e-4)


def test_a_height_map_for_drawing_has_the_gradient_of_the_limited_heights() -> None:
    height = (3.0 * ATLAS.positions[..., 2]).astype(np.float32)
    limited = DisplacementLimit(ATLAS)(height)
    np.testing.assert_array_equal(HeightMap.drawn(ATLAS)(height), HeightMap(ATLAS.texels)(limited))
    np.testing.assert_array_equal(HeightMap.drawn(ATLAS, limit=False)(height), HeightMap(ATLAS.texels)(height))
    assert np.abs(limited).max() < np.abs(height).max() / 4
