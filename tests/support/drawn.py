"""Frames of small MuJoCo scenes."""

from mujoco_models import posed
from sphere_height_maps import cube_charts

from ripple_sim.render import Camera, Renderer, Surface, srgb_to_linear
from ripple_sim.render.visuals import shapes

SIZE = (160, 120)
ABOVE = Camera((0.0, 0.0, 0.0), 4.0, 90.0, -89.9, 40.0)  # the frame's up is +y, its right +x
FRONT = Camera((0.0, 0.0, 0.5), 4.0, 90.0, -10.0, 40.0)

FLOOR = '<geom type="plane" size="0 0 .1" rgba=".8 .8 .8 1"/>'
BALL = '<geom type="sphere" size=".3" pos="0 0 .8" rgba=".8 .2 .2 1"/>'
SUN = '<light directional="true" pos="0 0 3" dir="{} 0 -1" diffuse=".8 .8 .8" castshadow="{}"/>'
SPOT = '<light pos="{} 0 2" dir="{} 0 -1" diffuse=".9 .9 .9" cutoff="60" exponent="1"/>'


def frame_of(gl, body, *, asset="", visual="", camera=ABOVE, targets=None, size=SIZE, **options):
    """Frame, as integers, of a scene given by the contents of its MJCF's elements."""
    xml = f"<mujoco><visual>{visual}</visual><asset>{asset}</asset><worldbody>{body}</worldbody>"
    xml += "</mujoco>"
    model, data = posed(xml)
    surfaces = {model.geom(name).id: surface for name, surface in (targets or {}).items()}
    with Renderer(gl, model, surfaces, size=size, **options) as renderer:
        return renderer.render(data, {}, camera).astype(int)


def light_of(gl, body, **options):
    """The same frame in linear light."""
    return srgb_to_linear(frame_of(gl, body, **options) / 255)


def ball_surface(look: str, radius: float = 0.5, resolution: int = 8) -> Surface:
    ball = shapes.ball(16)
    return Surface(radius * ball.shell, ball.faces, cube_charts(ball.shell, resolution), look)
