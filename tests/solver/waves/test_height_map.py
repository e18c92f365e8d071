"""The height map: second-order gradients everywhere, continuous over the cube's edges and corners."""

from functools import partial

import numpy as np
import pytest
from hand_made import disk, polygon, square

from ripple_sim.solver import HeightMap, sphere_atlas


def field_and_gradient(d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x, y, z = np.moveaxis(d, -1, 0)
    gradient = np.stack([3 * np.cos(3 * x) * y, np.sin(3 * x), 2 * z], axis=-1)
    gradient -= (gradient * d).sum(axis=-1, keepdims=True) * d
    return np.sin(3 * x) * y + z**2, gradient


def test_gradient_converges_at_second_order_also_at_the_cubes_edges() -> None:
    errors = []
    for n in (16, 32, 64):
        atlas = sphere_atlas(1.0, n)
        h, gradient = field_and_gradient(atlas.positions)
        height_map = HeightMap(atlas.texels)(h.astype(np.float32))[:, 1:-1, 1:-1]
        np.testing.assert_array_equal(height_map[..., 3], h.astype(np.float32))
        errors.append(np.linalg.norm(height_map[..., :3] - gradient, axis=-1).max())
    assert np.log2(errors[0] / errors[1]) > 1.8
    assert np.log2(errors[1] / errors[2]) > 1.8


def test_halo_makes_interpolation_continuous() -> None:
    n = 12
    atlas = sphere_atlas(1.0, n)
    h, _ = field_and_gradient(atlas.positions)
    height_map = HeightMap(atlas.texels)(h.astype(np.float32))
    # where three charts meet, each chart's bilinear value at the cube's corner is the mean of the same three texels
    corners = {}
    for chart in range(6):
        for r, c in ((0, 0), (0, n), (n, 0), (n, n)):
            cell = height_map[chart, r : r + 2, c : c + 2].reshape(4, 4)
            value = tuple(np.round(cell.mean(axis=0), 5))
            corners.setdefault(value, []).append(chart)
    assert len(corners) == 8
    assert all(len(charts) == 3 for charts in corners.values())


def interpolated(height_map: np.ndarray, r: float, c: float) -> np.ndarray:
    """Bilinear heights of all charts at a place of theirs [texels], which begins at 0 at the charts' border."""
    i, j = int(r + 0.5), int(c + 0.5)
    s, t = r + 0.5 - i, c + 0.5 - j
    h = height_map[..., 3]
    above, below = ((1 - t) * h[:, row, j] + t * h[:, row, j + 1] for row in (i, i + 1))
    return (1 - s) * above + s * below


@pytest.mark.parametrize("shape", [square, disk, partial(polygon, 6)], ids=["square", "disk", "hexagon"])
def test_heights_that_are_drawn_come_to_zero_at_a_fixed_rim(shape) -> None:
    n = 8
    texels = shape(n).with_fixed_rim()
    height_map = HeightMap(texels)(np.random.default_rng(1).standard_normal(texels.positions.shape[:3]))
    rim = texels.topology.rim
    assert np.isfinite(height_map).all()
    assert rim.any()
    for along in np.linspace(0, n, 4 * n + 1):
        for side, place in enumerate(((0.0, along), (along, float(n)), (float(n), along), (along, 0.0))):
            at_rim = texels.topology.glued[:, side, 0] < 0
            assert np.abs(interpolated(height_map, *np.minimum(place, n - 1e-9))[at_rim]).max(initial=0.0) < 1e-6


def test_gradient_beside_a_fixed_rim_converges() -> None:
    errors = []
    for n in (16, 32, 64):
        texels = square(n).with_fixed_rim()
        x, y, _ = np.moveaxis(texels.positions, -1, 0)
        h = np.sin(np.pi * x) * np.sin(2 * np.pi * y)
        exact = np.pi * np.stack(
            [np.cos(np.pi * x) * np.sin(2 * np.pi * y), 2 * np.sin(np.pi * x) * np.cos(2 * np.pi * y)], axis=-1
        )
        found = HeightMap(texels)(h.astype(np.float32))[:, 1:-1, 1:-1, :2]
        errors.append(np.abs(found - exact).max())
    assert np.log2(errors[0] / errors[1]) > 1.8
    assert np.log2(errors[1] / errors[2]) > 1.8
