"""Heights that stay on the GPU: the same as those read back, and the height map made there is the host's."""

from functools import partial

import numpy as np
import pytest
from hand_made import disk, polygon

from ripple_sim.solver import HeightMap, Material, SolverError, WaveSolver, sphere_atlas
from ripple_sim.solver.backends.gl_fields import DeviceField
from ripple_sim.solver.gl import GLContext, shared_context
from ripple_sim.solver.texels.texel_atlas import ChartPage
from ripple_sim.solver.waves.height_map import DisplacementLimit

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
    """The charts [C, n + 2, n + 2, 4] that are in the second layer of a texture, and the largest height drawn."""
    page = ChartPage(*heights.shape[:2])
    with gl as ctx:
        texture = ctx.texture_array((*page.size, 2), 4, dtype="f4")
        highest = height_map(on_device(gl, heights)).fill(texture, 1)
        texels = np.frombuffer(texture.read(), np.float32).reshape(2, *page.size[::-1], 4)[1]
        texture.release()
    corners = [page.corner(chart) for chart in range(page.charts)]
    return np.stack([texels[y : y + page.block, x : x + page.block] for x, y in corners]), highest


@pytest.mark.parametrize("shape", ["sphere", "hexagon", "free disk", "fixed disk", "fixed hexagon"])
def test_the_page_is_the_hosts_height_map(hardware, shape) -> None:
    texels = {
        "sphere": lambda n: sphere_atlas(1.0, n).texels,
        "hexagon": partial(polygon, 6),
        "free disk": disk,
        "fixed disk": lambda n: disk(n).with_fixed_rim(),
        "fixed hexagon": lambda n: polygon(6, n).with_fixed_rim(),
    }[shape](N)
    heights = np.random.default_rng(3).standard_normal(texels.positions.shape[:3]).astype(np.float32)
    height_map = HeightMap(texels)
    page, highest = page_of(hardware, height_map, heights)
    host = height_map(heights)
    np.testing.assert_array_equal(page[:, 1:-1, 1:-1, 3], heights)
    np.testing.assert_allclose(page, host, rtol=0, atol=1e-5 * np.abs(host[..., :3]).max())
    np.testing.assert_allclose(page[..., 3], host[..., 3], rtol=0, atol=1e-6 * np.abs(heights).max())
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


def test_a_snapshot_is_the_height_and_stays_while_the_waves_go_on(hardware) -> None:
    material = Material(speed=1.0, yield_height=1e-4)
    waves = WaveSolver(sphere_atlas(0.1, N), material, backend="gl")
    waves.add_impulse((0.1, 0, 0), 1e-3, 0.05)
    waves.step(1e-3)
    before, height = waves.snapshot(), waves.height
    waves.step(1e-2)
    after, later = waves.snapshot(), waves.height
    assert isinstance(before, DeviceField)
    assert waves.dent.any()
    np.testing.assert_array_equal(np.asarray(before), height)
    np.testing.assert_array_equal(np.asarray(after), later)
    assert (before.peak, after.peak) == (np.abs(height).max(), np.abs(later).max())
    between = height + np.float32(0.3) * (later - height)
    np.testing.assert_allclose(np.asarray(before.blend(after, 0.3)), between, rtol=0, atol=1e-7 * np.abs(between).max())


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_heights_that_are_not_finite_are_refused(hardware, value) -> None:
    heights = np.zeros((6, N, N), np.float32)
    heights[3, 2, 1] = value
    with pytest.raises(SolverError, match="no longer finite"):
        page_of(hardware, HeightMap(sphere_atlas(1.0, N).texels), heights)
