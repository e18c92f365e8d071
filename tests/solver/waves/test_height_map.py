"""The height map: second-order gradients everywhere, continuous over the cube's edges and corners."""

import numpy as np

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
