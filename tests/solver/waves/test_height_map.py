"""The height map: second-order gradients, continuity, both backends; its limit."""

from functools import partial

import numpy as np
import pytest
from hand_made import disk, polygon, square
from modes import orders

from ripple_sim.solver import HeightMap, Material, SolverError, WaveSolver, sphere_atlas
from ripple_sim.solver.backends import DeviceField
from ripple_sim.solver.gl import GLContext, shared_context
from ripple_sim.solver.texels import ChartPage
from ripple_sim.solver.waves import FREE_SHARE, MAX_SHARE, DisplacementLimit


def test_gradient_converges_at_second_order_also_at_the_cubes_edges() -> None:
    errors = []
    for n in (16, 32, 64):
        atlas = sphere_atlas(1.0, n)
        x, y, z = np.moveaxis(atlas.positions, -1, 0)
        h = (np.sin(3 * x) * y + z**2).astype(np.float32)
        gradient = np.stack([3 * np.cos(3 * x) * y, np.sin(3 * x), 2 * z], axis=-1)
        gradient -= (gradient * atlas.normals).sum(axis=-1, keepdims=True) * atlas.normals
        height_map = HeightMap(atlas.texels)(h)[:, 1:-1, 1:-1]
        np.testing.assert_array_equal(height_map[..., 3], h)
        errors.append(np.linalg.norm(height_map[..., :3] - gradient, axis=-1).max())
    assert (orders(errors) > 1.8).all()


def interpolated(height_map: np.ndarray, r: float, c: float) -> np.ndarray:
    """Bilinear heights of all charts at a place [texels] that begins at the border."""
    i = int(r + 0.5)
    j = int(c + 0.5)
    s = r + 0.5 - i
    t = c + 0.5 - j
    h = height_map[..., 3]
    above, below = ((1 - t) * h[:, row, j] + t * h[:, row, j + 1] for row in (i, i + 1))
    return (1 - s) * above + s * below


@pytest.mark.parametrize(
    "shape", [square, disk, partial(polygon, 6)], ids=["square", "disk", "hexagon"]
)
def test_heights_that_are_drawn_come_to_zero_at_a_fixed_rim(shape) -> None:
    n = 8
    texels = shape(n).with_fixed_rim()
    height_map = HeightMap(texels)(
        np.random.default_rng(1).standard_normal(texels.positions.shape[:3])
    )
    rim = texels.topology.rim
    assert np.isfinite(height_map).all()
    assert rim.any()
    for along in np.linspace(0, n, 4 * n + 1):
        for side, place in enumerate(
            ((0.0, along), (along, float(n)), (float(n), along), (along, 0.0))
        ):
            at_rim = texels.topology.glued[:, side, 0] < 0
            assert (
                np.abs(interpolated(height_map, *np.minimum(place, n - 1e-9))[at_rim]).max(
                    initial=0.0
                )
                < 1e-6
            )


def test_gradient_beside_a_fixed_rim_converges() -> None:
    errors = []
    for n in (16, 32, 64):
        texels = square(n).with_fixed_rim()
        x, y, _ = np.pi * np.moveaxis(texels.positions, -1, 0)
        h = np.sin(x) * np.sin(2 * y)
        exact = np.pi * np.stack(
            [np.cos(x) * np.sin(2 * y), 2 * np.sin(x) * np.cos(2 * y)], axis=-1
        )
        found = HeightMap(texels)(h.astype(np.float32))[:, 1:-1, 1:-1, :2]
        errors.append(np.abs(found - exact).max())
    assert (orders(errors) > 1.8).all()


N = 8


@pytest.fixture
def hardware(opengl, monkeypatch) -> GLContext:
    """The software driver, taken for hardware: what it computes stays with it."""
    monkeypatch.setattr(GLContext, "software", False)
    return shared_context()


def on_device(gl: GLContext, heights: np.ndarray) -> DeviceField:
    with gl as ctx:
        addresses = ctx.buffer(np.arange(heights.size, dtype=np.int32).tobytes())
        return DeviceField.gathered(gl, heights.shape, addresses, ctx.buffer(heights.tobytes()))


def page_of(gl: GLContext, height_map: HeightMap, heights: np.ndarray) -> tuple[np.ndarray, float]:
    """The charts [C, n + 2, n + 2, 4] in a texture's second layer, and the largest height."""
    page = ChartPage(*heights.shape[:2])
    with gl as ctx:
        texture = ctx.texture_array((*page.size, 2), 4, dtype="f4")
        highest = height_map(on_device(gl, heights)).fill(texture, 1)
        texels = np.frombuffer(texture.read(), np.float32).reshape(2, *page.size[::-1], 4)[1]
        texture.release()
    corners = [page.corner(chart) for chart in range(page.charts)]
    return np.stack([texels[y : y + page.block, x : x + page.block] for x, y in corners]), highest


@pytest.mark.parametrize("shape", ["sphere", "hexagon", "free disk", "fixed disk", "fixed hexagon"])
def test_the_page_on_the_gpu_equals_the_height_map_on_the_cpu(hardware, shape) -> None:
    texels = {
        "sphere": lambda n: sphere_atlas(1.0, n).texels,
        "hexagon": partial(polygon, 6),
        "free disk": disk,
        "fixed disk": lambda n: disk(n).with_fixed_rim(),
        "fixed hexagon": lambda n: polygon(6, n).with_fixed_rim(),
    }[shape](N)
    heights = (
        np.random.default_rng(3).standard_normal(texels.positions.shape[:3]).astype(np.float32)
    )
    height_map = HeightMap(texels)
    page, highest = page_of(hardware, height_map, heights)
    host = height_map(heights)
    np.testing.assert_array_equal(page[:, 1:-1, 1:-1, 3], heights)
    np.testing.assert_allclose(page, host, rtol=0, atol=1e-5 * np.abs(host[..., :3]).max())
    np.testing.assert_allclose(
        page[..., 3], host[..., 3], rtol=0, atol=1e-6 * np.abs(heights).max()
    )
    assert highest == np.abs(heights).max()
    np.testing.assert_array_equal(np.asarray(height_map(on_device(hardware, heights))), host)


def test_heights_too_large_for_the_object_are_bent_as_on_the_host(hardware) -> None:
    atlas = sphere_atlas(1.0, N)
    heights = np.linspace(-2.0, 1.0, 6 * N * N, dtype=np.float32).reshape(6, N, N)
    height_map = HeightMap(atlas.texels, DisplacementLimit(atlas))
    page, highest = page_of(hardware, height_map, heights)
    host = height_map(heights)
    assert host[..., 3].min() > -1.0
    np.testing.assert_allclose(page, host, rtol=0, atol=1e-5)
    assert highest == pytest.approx(np.abs(host[..., 3]).max(), rel=1e-6)


def test_a_snapshot_stays_while_the_waves_advance(hardware) -> None:
    material = Material(speed=1.0, yield_height=1e-4)
    waves = WaveSolver(sphere_atlas(0.1, N), material, backend="gl")
    waves.add_impulse((0.1, 0, 0), 1e-3, 0.05)
    waves.step(1e-3)
    before = waves.snapshot()
    height = waves.height
    waves.step(1e-2)
    after = waves.snapshot()
    later = waves.height
    assert isinstance(before, DeviceField)
    assert waves.dent.any()
    np.testing.assert_array_equal(np.asarray(before), height)
    np.testing.assert_array_equal(np.asarray(after), later)
    assert (before.peak, after.peak) == (np.abs(height).max(), np.abs(later).max())
    between = height + np.float32(0.3) * (later - height)
    np.testing.assert_allclose(
        np.asarray(before.blend(after, 0.3)), between, rtol=0, atol=1e-7 * np.abs(between).max()
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_heights_that_are_not_finite_are_refused(hardware, value) -> None:
    heights = np.zeros((6, N, N), np.float32)
    heights[3, 2, 1] = value
    with pytest.raises(SolverError, match="no longer finite"):
        page_of(hardware, HeightMap(sphere_atlas(1.0, N).texels), heights)


ATLAS = sphere_atlas(2.0, 12)
SHAPE = ATLAS.areas.shape


def drawn(height: float) -> float:
    return float(DisplacementLimit(ATLAS)(np.full(SHAPE, height, np.float32))[0, 6, 6])


def test_heights_up_to_a_quarter_of_the_radius_are_drawn_as_they_are() -> None:
    height = np.random.default_rng(0).uniform(-0.49, 0.49, SHAPE).astype(np.float32)
    assert DisplacementLimit(ATLAS)(height) is height
    assert FREE_SHARE * 2.0 == 0.5


@pytest.mark.parametrize("sign", [-1, 1])
def test_the_drawn_height_grows_smoothly_towards_the_limit(sign: int) -> None:
    limit = DisplacementLimit(ATLAS)
    heights = np.linspace(0.3, 8.0, 800)
    seen = np.array([sign * limit(np.full(SHAPE, sign * h, np.float32))[0, 6, 6] for h in heights])
    assert (np.diff(seen)[:300] > 0).all() and (np.diff(seen) >= 0).all()
    assert seen.max() <= MAX_SHARE * 2.0 * (1 + 1e-3)
    # slope and curvature have no jump where the bend begins
    slope = np.gradient(seen, heights)
    assert slope.max() <= 1.001
    assert np.abs(np.diff(slope)).max() < 0.02


@pytest.mark.parametrize("height", [1e6, -1e30, np.finfo(np.float32).max])
def test_no_height_is_too_large(height: float) -> None:
    assert abs(drawn(height)) == pytest.approx(MAX_SHARE * 2.0, rel=1e-3)
    assert np.sign(drawn(height)) == np.sign(height)


def test_the_limit_is_the_same_at_every_scale() -> None:
    field = np.random.default_rng(1).standard_normal(SHAPE)
    shares = [
        DisplacementLimit(sphere_atlas(r, 12))((r * field).astype(np.float32)) / r
        for r in (1e-3, 1.0, 1e3)
    ]
    np.testing.assert_allclose(shares[0], shares[1], rtol=1e-4)
    np.testing.assert_allclose(shares[2], shares[1], rtol=1e-4)


def test_a_height_map_for_drawing_has_the_gradient_of_the_limited_heights() -> None:
    height = (3.0 * ATLAS.positions[..., 2]).astype(np.float32)
    limited = DisplacementLimit(ATLAS)(height)
    np.testing.assert_array_equal(HeightMap.drawn(ATLAS)(height), HeightMap(ATLAS.texels)(limited))
    np.testing.assert_array_equal(
        HeightMap.drawn(ATLAS, limit=False)(height), HeightMap(ATLAS.texels)(height)
    )
    assert np.abs(limited).max() < np.abs(height).max() / 4
