"""On the GPU the triangles are those of the host, and so is the frame."""

import mujoco
import numpy as np
import pytest
from sphere_height_maps import cube_charts

from ripple_sim.render import Camera, Renderer, Surface
from ripple_sim.render.surfaces import adaptive
from ripple_sim.render.visuals import shapes
from ripple_sim.solver import HeightMap, sphere_atlas
from ripple_sim.solver.backends.gl_fields import DeviceField

N, SIZE = 16, (120, 480)  # so high that there are edges to be split


def waves(atlas, depth):
    d = atlas.positions
    return (depth * np.exp(-(((d - [0.0, 0.6, 0.8]) / 0.2) ** 2).sum(axis=-1))).astype(np.float32)


@pytest.fixture(scope="module")
def scene(gl):
    """A renderer of a ball and its atlas, and what draws its height field: from the host's memory, or on the GPU."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="3 3 .1"/><geom type="sphere" size=".5" pos="0 0 .5"/>'
        '<geom type="sphere" size=".1" pos=".5 .4 .9"/></worldbody></mujoco>'
    )
    data, ball, atlas = mujoco.MjData(model), shapes.ball(16), sphere_atlas(1.0, N)
    mujoco.mj_forward(model, data)
    height_map = HeightMap(atlas.texels)
    targets = {1: Surface(0.5 * ball.shell, ball.faces, cube_charts(ball.shell, N), "rubber")}
    with Renderer(gl, model, targets, size=SIZE) as renderer:

        def frame(heights, on_device):
            if on_device:
                with gl as ctx:
                    addresses = ctx.buffer(np.arange(heights.size, dtype=np.int32).tobytes())
                    heights = DeviceField.gathered(gl, heights.shape, addresses, ctx.buffer(heights.tobytes()))
            return renderer.render(data, {1: height_map(heights)}, Camera((0, 0, 0.5), 2.0, 60.0, -20.0)).astype(int)

        yield renderer, atlas, frame


@pytest.mark.parametrize("depth", [0.0, 0.03, -0.1])
def test_frames_are_those_of_the_host(scene, depth) -> None:
    _, atlas, frame = scene
    on_host = frame(waves(atlas, depth), False)
    assert np.abs(frame(waves(atlas, depth), True) - on_host).max() <= 1
    # the host's triangles are back afterwards
    np.testing.assert_array_equal(frame(waves(atlas, depth), False), on_host)


@pytest.mark.parametrize("group", [32, 256])
def test_the_triangles_are_the_hosts_in_their_order(gl, scene, group, monkeypatch) -> None:
    monkeypatch.setattr(adaptive, "_GROUP", group)  # of 32 there are more than a group has threads
    renderer, atlas, frame = scene
    (target,) = renderer._scene.targets
    host, target._on_device = target._adaptive, None
    for seed, depth in ((0, 0.0), (1, 0.02), (2, 0.2)):
        noise = np.random.default_rng(seed).normal(0.0, 1.0, (6, N, N)).astype(np.float32)
        heights = np.float32(depth) * noise * (np.abs(noise) > 1)
        frame(heights, True)
        triangles, used = host(HeightMap(atlas.texels)(heights))
        with gl:
            split = np.frombuffer(target._midpoints.read(), np.int32)
            count = np.frombuffer(target._count.read(), np.int32)
            indices = np.frombuffer(target._indices.read(), np.int32)[: count[0]]
        np.testing.assert_array_equal(count[1:], [1, 0, 0, 0])
        np.testing.assert_array_equal(indices.reshape(-1, 3), triangles)
        np.testing.assert_array_equal(np.flatnonzero(split) + host.base_count, used)
        assert (len(used) > 0) == (depth > 0)
