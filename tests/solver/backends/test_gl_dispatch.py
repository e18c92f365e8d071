"""Compute shaders, run over blocks and lists, against numpy."""

import numpy as np
import pytest
from hand_made import flat_torus, square

from ripple_sim.solver import TexelMesh
from ripple_sim.solver.backends.gl_dispatch import Dispatch
from ripple_sim.solver.backends.gl_fields import FieldLayout
from ripple_sim.solver.gl import GLContext, shared_context

pytestmark = pytest.mark.usefixtures("opengl")


def field(texels: TexelMesh, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(texels.shape).astype(np.float32)


def fill_halo(dispatch: Dispatch, layout: FieldLayout, buffer) -> None:
    halo = dispatch.shader("halo")
    halo["count"] = layout.halo_count
    dispatch.bind(buffer, layout.halo_pairs)
    dispatch.run_list(halo, layout.halo_count)


@pytest.mark.parametrize("software", [True, False], ids=["software blocks", "hardware blocks"])
@pytest.mark.parametrize("texels", [square(1), square(66), flat_torus(17)], ids=lambda each: str(each.shape))
@pytest.mark.parametrize("defines", [{}, {"FACTOR": 1}, {"SUBTRACT": 1}, {"SUBTRACT": 1, "ADD": 1}], ids=str)
def test_blocks_cover_every_texel_once(
    monkeypatch: pytest.MonkeyPatch, texels: TexelMesh, software: bool, defines: dict[str, int]
) -> None:
    monkeypatch.setattr(GLContext, "software", software)
    gl = shared_context()
    layout = FieldLayout(gl, texels.topology)
    dispatch = Dispatch(gl, layout)
    x, factor, before = (field(texels, seed) for seed in range(3))
    stencil = texels.stencil(np.ones(texels.shape))
    with gl:
        buffer, result = layout.upload(x), layout.upload(before)
        fill_halo(dispatch, layout, buffer)
        dispatch.bind(buffer, result, None, layout.upload_stencil(stencil), layout.upload(factor))
        dispatch.run_blocks(dispatch.block_shader("apply", **defines))
    expected = stencil(x.astype(float))
    expected *= (factor if "FACTOR" in defines else 1) * (-1 if "SUBTRACT" in defines else 1)
    expected += before if "ADD" in defines else 0
    np.testing.assert_allclose(layout.read(result), expected, atol=2e-5 * max(1, np.abs(expected).max()))


@pytest.mark.parametrize("count", [1, 63, 64, 65, 200])
def test_a_list_is_run_to_its_last_entry_and_not_beyond(count: int) -> None:
    gl, texels = shared_context(), square(15)
    layout = FieldLayout(gl, texels.topology)
    dispatch = Dispatch(gl, layout)
    h, v = field(texels, 3), field(texels, 4)
    kicks = np.random.default_rng(5).standard_normal(225).astype(np.float32)
    with gl as ctx:
        height, velocity = layout.upload(h), layout.upload(v)
        places = ctx.buffer(layout.texels.astype(np.int32).tobytes())
        shader = dispatch.shader("kick")
        shader["count"], shader["dt"] = count, 0.5
        dispatch.bind(height, velocity, places, ctx.buffer(kicks.tobytes()))
        dispatch.run_list(shader, count)
    kicks[count:] = 0
    np.testing.assert_allclose(layout.read(velocity).ravel(), v.ravel() + kicks, rtol=1e-6)
    np.testing.assert_allclose(layout.read(height).ravel(), h.ravel() + 0.5 * kicks, rtol=1e-5, atol=1e-6)


def test_a_binding_without_a_buffer_stays_as_it_is() -> None:
    gl, texels = shared_context(), square(4)
    layout = FieldLayout(gl, texels.topology)
    dispatch = Dispatch(gl, layout)
    with gl as ctx:
        shader = dispatch.shader("kick")
        shader["count"], shader["dt"] = 2, 1.0
        first, second, v = layout.zeros(), layout.zeros(), layout.zeros()
        places = ctx.buffer(layout.texels[:2].astype(np.int32).tobytes())
        kicks = ctx.buffer(np.ones(2, np.float32).tobytes())
        dispatch.bind(first, v, places, kicks)
        dispatch.bind(second, None, None, None)
        dispatch.run_list(shader, 2)
    assert not layout.read(first).any()
    assert layout.read(second).sum() == layout.read(v).sum() == 2
