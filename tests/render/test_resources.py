"""Resources of the GPU are released, uniforms read as they were set, textures as linear light."""

import gc
import sys

import moderngl
import mujoco
import numpy as np
import pytest
from drawn import BALL, FLOOR
from shader_functions import evaluated

from ripple_sim.errors import RippleWarning
from ripple_sim.render import (
    Camera,
    Pose,
    Renderer,
    fitted,
    srgb_cube,
    srgb_texture,
    srgb_to_linear,
)
from ripple_sim.render.frame_pass import FramePass
from ripple_sim.render.g_buffer import GBuffer
from ripple_sim.render.readback import Readback


def test_renderers_leave_nothing_behind(gl):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{FLOOR}{BALL}</worldbody></mujoco>")

    def make() -> tuple[int, set[int]]:
        renderer = Renderer(gl, model, {}, size=(16, 12), samples=0)
        made = list(renderer._resources._created)
        del renderer
        gc.collect()
        with gl:
            left = [each for each in made if type(each.mglo).__name__ != "InvalidObject"]
            programs = {
                each.glo
                for each in left
                if isinstance(each, moderngl.Program | moderngl.ComputeShader)
            }
            return len(left) - len(programs), programs

    gc.collect()  # the programs of earlier tests' renderers must not come in between
    others, programs = zip(*(make() for _ in range(8)), strict=True)
    assert others == (0,) * 8
    assert programs == programs[:1] * 8


def test_a_renderer_that_is_collected_while_another_draws_changes_no_pixel(gl):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{FLOOR}{BALL}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = Camera((0.0, 0.0, 0.5), 4.0, 90.0, -10.0, 40.0)

    def frame_while(end_another, moment):
        """A frame of ours, in which another one ends at a pass."""
        forgotten = [Renderer(gl, model, {}, size=(16, 12), samples=0)]
        forgotten[0].render(data, {}, camera)
        calls = 0

        def at_call(frame, event, argument):
            nonlocal calls
            calls += event == "call" and frame.f_code is FramePass.run.__code__
            if forgotten and calls == moment:
                end_another(forgotten)

        sys.setprofile(at_call)
        try:
            return drawing.render(data, {}, camera)
        finally:
            sys.setprofile(None)
            assert not forgotten

    def close(forgotten):
        forgotten.pop().close()

    with Renderer(gl, model, {}, size=(16, 12), samples=0) as drawing:
        expected = drawing.render(data, {}, camera)
        for moment in (1, 2):
            for end_another in (list.clear, close):
                np.testing.assert_array_equal(frame_while(end_another, moment), expected)


SHINY = """<mujoco><asset><material name="shiny" reflectance=".4" rgba=".8 .8 .8 1"/></asset>
<worldbody>
<geom type="plane" size="0 0 .1" material="shiny"/>
<geom type="sphere" size=".3" pos="0 0 .8" rgba=".8 .2 .2 1"/>
<geom type="sphere" size=".2" pos=".6 0 .8" rgba=".2 .2 .9 .5"/></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("owner", "name", "moments"),
    [(FramePass, "run", (2, 5, 8)), (GBuffer, "clear", (2,)), (Readback, "fetch", (1,))],
)
def test_after_an_interrupted_frame_the_next_is_right_also_in_other_renderers(
    gl, monkeypatch, owner, name, moments
):
    """As after Ctrl-C in a notebook: masks, scissors or winding are still set."""
    model = mujoco.MjModel.from_xml_string(SHINY)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = Camera((0.0, 0.0, 0.5), 4.0, 90.0, -10.0, 40.0)
    elsewhere = Camera((0.0, 0.0, 0.5), 3.0, 60.0, -10.0, 40.0)
    function = getattr(owner, name)
    with (
        Renderer(gl, model, {}, size=(32, 24)) as renderer,
        Renderer(gl, model, {}, size=(16, 12)) as other,
    ):
        expected, of_other = (each.render(data, {}, camera) for each in (renderer, other))
        assert np.ptp(expected)
        for moment in moments:
            calls = 0

            def interrupt(*arguments, moment=moment):
                nonlocal calls
                calls += 1
                if calls == moment:
                    raise KeyboardInterrupt
                return function(*arguments)

            with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
                patch.setattr(owner, name, interrupt)
                renderer.render(data, {}, elsewhere)
            np.testing.assert_array_equal(
                renderer.render(data, {}, camera), expected, err_msg=f"{name}, call {moment}"
            )
            np.testing.assert_array_equal(other.render(data, {}, camera), of_other)


POSE = Camera((0.3, -1.2, 0.7), 5.0, 130.0, -35.0, 50.0).pose()
THROUGH_LENS = Pose(POSE.position, POSE.rotation, POSE.distance, POSE.fovy, (0.1, -0.2), 3.0)
ASPECT = 1.6


@pytest.mark.parametrize("pose", [POSE, THROUGH_LENS], ids=["pinhole", "lens"])
def test_rays_lead_where_the_matrix_projects(frame, pose):
    """A point along the ray of a place in the frame is drawn at that place."""
    frame.set_camera(pose, ASPECT)
    values = {
        name: frame.values[name].astype(np.float64)
        for name in ("eye", "ray", "ray_right", "ray_up")
    }
    matrix = frame.values["view_projection"].astype(np.float64).T
    for x, y in np.random.default_rng(0).uniform(-1, 1, (20, 2)):
        way = values["ray"][:3] + x * values["ray_right"][:3] + y * values["ray_up"][:3]
        for distance in (0.2, 3.0, 40.0):
            clip = matrix @ [*(values["eye"][:3] + distance * way), 1.0]
            np.testing.assert_allclose(clip[:2] / clip[3], [x, y], atol=2e-5)
            # a metre along the axis for each of the ray
            assert clip[3] == pytest.approx(distance, rel=1e-5)


def test_clip_planes_lie_before_and_behind_the_focus(frame):
    frame.set_camera(POSE, ASPECT)
    near = frame.values["ray"][3]
    far = frame.values["ray_right"][3]
    assert 0 < near < POSE.distance < far
    matrix = frame.values["view_projection"].T.astype(np.float64)
    for plane, depth in ((near, -1), (far, 1)):
        clip = matrix @ [*(POSE.eye - float(plane) * POSE.rotation[:, 2]), 1.0]
        assert clip[2] / clip[3] == pytest.approx(depth, abs=1e-3)


@pytest.mark.parametrize("pose", [POSE, THROUGH_LENS], ids=["pinhole", "lens"])
def test_shaders_read_what_was_set(gl, frame, pose):
    """Matrices are stored column by column; a vector's fourth number may be left out."""
    frame.set_camera(pose, ASPECT)
    frame.set_vector("zenith", [0.1, 0.2, 0.3])
    frame.set_vector("counts", [3.0, 4.0, 5.0], 6.0)
    with gl:
        frame.bind()
    points = np.column_stack([np.random.default_rng(2).normal(size=(50, 3)), np.ones(50)])
    file = "glsl/frame.glsl"
    expected = points @ frame.values["view_projection"].astype(np.float64)
    np.testing.assert_allclose(
        evaluated(gl, file, "view_projection * x", points), expected, atol=1e-3
    )
    one = np.zeros((1, 1))
    np.testing.assert_allclose(
        evaluated(gl, file, "zenith", one), [[0.1, 0.2, 0.3, 0.0]], rtol=1e-6
    )
    np.testing.assert_allclose(evaluated(gl, file, "counts", one), [[3, 4, 5, 6]])
    np.testing.assert_allclose(
        evaluated(gl, file, "vec4(focus.xyz, eye.w)", one)[0, 3], pose.distance, rtol=1e-6
    )


SAMPLE = """#version 430
layout(local_size_x = 1) in;
layout(std430, binding = 0) readonly buffer Places { vec4 places[]; };
layout(std430, binding = 1) writeonly buffer Colors { vec4 colors[]; };
uniform SAMPLER image;
void main() {
    uint i = gl_GlobalInvocationID.x;
    colors[i] = textureLod(image, places[i].COORDINATES, places[i].w);
}
"""


def sampled(resources, texture, places, kind="2D") -> np.ndarray:
    """Colours [k, 3] at texture coordinates or directions; the last number is the mipmap level."""
    source = SAMPLE.replace("SAMPLER", f"sampler{kind}").replace(
        "COORDINATES", "xy" if kind == "2D" else "xyz"
    )
    places = np.asarray(places, dtype=np.float32)
    with resources.gl as ctx:
        shader = ctx.compute_shader(source)
        given = ctx.buffer(places.tobytes())
        got = ctx.buffer(reserve=places.nbytes)
        given.bind_to_storage_buffer(0)
        got.bind_to_storage_buffer(1)
        texture.use(0)
        shader.run(len(places))
        ctx.memory_barrier()
        return np.frombuffer(got.read(), np.float32).reshape(-1, 4)[:, :3]


@pytest.mark.usefixtures("computes")
def test_every_byte_reads_as_linear_light(resources):
    pixels = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    middles = [[(i + 0.5) / 256, 0.5, 0, 0] for i in range(256)]
    got = sampled(resources, srgb_texture(resources, pixels), middles)
    np.testing.assert_allclose(got, srgb_to_linear(pixels[0] / 255), atol=2e-3)


@pytest.mark.usefixtures("computes")
@pytest.mark.parametrize("size", [(1, 1), (2, 3), (5, 7)])
def test_the_first_row_is_at_v_zero_and_the_picture_repeats(resources, size):
    """Also where rows are no multiple of four bytes."""
    height, width = size
    pixels = np.random.default_rng(1).integers(0, 256, (height, width, 3), dtype=np.uint8)
    texture = srgb_texture(resources, pixels)
    row, column = np.divmod(np.arange(height * width), width)
    places = np.stack([(column + 0.5) / width, (row + 0.5) / height, 0 * row, 0 * row], axis=1)
    expected = srgb_to_linear(pixels.reshape(-1, 3) / 255)
    for shift in ([0, 0, 0, 0], [1, 0, 0, 0], [-2, 3, 0, 0]):
        np.testing.assert_allclose(sampled(resources, texture, places + shift), expected, atol=0.01)


@pytest.mark.usefixtures("computes")
def test_small_pictures_of_a_texture_are_means_of_light_not_of_codes(resources):
    """Half black, half white: half the light, which is 188 in sRGB and not 128."""
    pixels = np.zeros((8, 8, 3), dtype=np.uint8)
    pixels[::2] = 255
    got = sampled(resources, srgb_texture(resources, pixels), [[0.3, 0.6, 0, 3]])
    np.testing.assert_allclose(got, 0.5, atol=0.01)


@pytest.mark.usefixtures("computes")
def test_faces_of_a_cube_lie_below_one_another(resources):
    """Right, left, up, down, front, back: along +x, -x, +y, -y, +z, -z."""
    faces = np.random.default_rng(2).integers(0, 256, (6, 3), dtype=np.uint8)
    pixels = np.repeat(faces, 16, axis=0).reshape(24, 4, 3)
    ways = np.concatenate([np.stack([axis, -axis]) for axis in np.eye(3)])
    got = sampled(
        resources, srgb_cube(resources, pixels), np.column_stack([ways, np.zeros(6)]), "Cube"
    )
    np.testing.assert_allclose(got, srgb_to_linear(faces / 255), atol=0.01)


def test_a_texture_too_large_for_the_driver_is_scaled_down_with_a_warning(
    resources,
) -> None:
    with resources.gl as ctx:
        largest = ctx.info["GL_MAX_TEXTURE_SIZE"]
    pixels = np.zeros((2, largest + 100, 3), np.uint8)
    pixels[:, : largest // 2] = 200
    with pytest.warns(
        RippleWarning, match=rf"a texture of {largest + 100}x2 pixels is larger than the {largest}"
    ):
        texture = srgb_texture(resources, pixels)
    assert texture.size == (largest, 2)
    pixels = np.zeros((40, 80, 3), np.uint8)
    pixels[:, :40] = (10, 100, 200)
    with pytest.warns(RippleWarning, match="scaled down to 20x10"):
        small = fitted(pixels, 20)
    np.testing.assert_array_equal(small, pixels[::4, ::4])
    assert fitted(pixels, 80) is pixels
