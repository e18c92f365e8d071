"""Images of heights that `add_height_map` puts into a model, for MuJoCo's simulate."""

import mujoco
import numpy as np
import pytest
from mujoco import rollout

from ripple_sim import Material, RippleError, Ripples, RippleWarning, add_height_map
from ripple_sim.coupling import hooks
from ripple_sim.coupling.map_sensors import MapSensor, texels_of_pixels

DT = 0.005
WIDTH = 24
HEIGHT = 16
LIMIT = 0.01  # [m]
MODEL = f"""<mujoco><option timestep="{DT}"/><worldbody>
<geom name="bell" type="sphere" size="0.1"/><geom name="ball" size="0.02" pos="1 0 0"/>
</worldbody></mujoco>"""


def specification(**options) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_string(MODEL)
    defaults = {"geom": "bell", "limit": LIMIT, "width": WIDTH, "height": HEIGHT}
    add_height_map(spec, "map", **(defaults | options))
    return spec


def rippling(model: mujoco.MjModel, geom: str = "bell") -> Ripples:
    material = Material(speed=0.5, damping=1.0, density=20.0)
    return Ripples(model, {geom: material}, resolution=8, backend="cpu")


def image_of(data: mujoco.MjData) -> np.ndarray:
    """The image [height, width, 3], top row first, without the number that counts images."""
    numbers = data.sensor("map").data.copy()
    numbers[-1] = numbers[-4]
    return numbers.reshape(HEIGHT, WIDTH, 3)[::-1]


def test_each_pixel_has_the_sign_of_its_texel() -> None:
    model = specification(rate=1 / DT).compile()
    data = mujoco.MjData(model)
    ripples = rippling(model)
    waves = ripples["bell"]
    waves.add_impulse([0.1, 0.0, 0.0], 1e-2, 0.03)
    for _ in range(5):
        ripples.mj_step(data)
    image = image_of(data)
    # six charts of 8 x 8 pixels, three beside each other
    for y in range(HEIGHT):
        for x in range(WIDTH):
            height = waves.height[3 * (y // 8) + x // 8, y % 8, x % 8]
            red, _, blue = image[y, x]
            if abs(height) > 0.01 * LIMIT:
                assert (red > blue) == (height > 0)
    assert np.abs(waves.height).max() > 0.1 * LIMIT


def test_images_come_at_their_rate_and_a_reset_empties_them() -> None:
    model = specification(rate=50.0).compile()
    data = mujoco.MjData(model)
    ripples = rippling(model)
    counts = []
    for _ in range(12):  # 60 ms
        ripples.mj_step(data)
        counts.append(data.sensor("map").data[-1])
    assert counts[0] == 1
    assert counts[-1] in (3, 4)  # a step may end just before the time of an image
    ripples.reset()
    assert not data.sensordata.any()


def test_heights_beyond_the_limit_have_its_colour() -> None:
    model = specification(rate=1 / DT, limit=1e-9).compile()
    data = mujoco.MjData(model)
    ripples = rippling(model)
    ripples["bell"].add_impulse([0.1, 0.0, 0.0], 1e-4, 0.03)
    ripples.mj_step(data)
    colors = np.unique(image_of(data).reshape(-1, 3), axis=0)
    assert [42.0, 78.0, 158.0] in colors.tolist()


def test_a_height_map_outlives_xml() -> None:
    model = mujoco.MjModel.from_xml_string(specification().to_xml())
    assert not model.sensor_intprm.any(), "MuJoCo's XML has no such attribute"
    data = mujoco.MjData(model)
    rippling(model).mj_step(data)
    assert model.sensor_intprm.tolist() == [[WIDTH, HEIGHT, 0]]
    assert (image_of(data) > 230).all(), "white where nothing has moved"


def test_a_changed_tuple_is_refused() -> None:
    xml = specification().to_xml()
    for old, new in (
        (f'prm="{WIDTH}"', 'prm="25"'),
        ('"geom" objname="bell"', '"body" objname="world"'),
    ):
        assert old in xml
        with pytest.raises(RippleError, match="tuple 'ripple-sim height map map' must have"):
            rippling(mujoco.MjModel.from_xml_string(xml.replace(old, new)))


@pytest.mark.parametrize("charts", [1, 5, 6, 50])
@pytest.mark.parametrize("size", [(24, 16), (100, 30), (16, 64)])
def test_every_chart_is_seen_once(charts: int, size: tuple[int, int]) -> None:
    width, height = size
    sensor = MapSensor("map", 0, LIMIT, 30.0, width, height, 0)
    texels = texels_of_pixels(sensor, (charts, 4, 4))
    assert texels.shape == (height, width)
    seen = np.unique(texels[texels >= 0] // 16)
    assert seen.tolist() == list(range(charts))


def test_an_image_with_too_few_pixels_is_refused() -> None:
    model = specification(width=2, height=1).compile()
    with pytest.raises(RippleError, match=r"a pixel or more for each of 6 charts, got 2 x 1"):
        rippling(model)


def test_a_height_map_of_a_geom_without_ripples_warns() -> None:
    model = specification(geom="ball").compile()
    with pytest.warns(RippleWarning, match="height map 'map' is of a geom that does not ripple"):
        rippling(model)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"geom": "gong"}, "no geom, flex or skin 'gong'"),
        ({"limit": 0.0}, "limit of a height map must be a number greater than 0, got 0.0"),
        ({"rate": float("nan")}, "rate of a height map must be a number greater than 0"),
        ({"width": 2.5}, "width of a height map must be a whole number from 1 to 2048"),
        ({"height": 4096}, "height of a height map must be a whole number from 1 to 2048"),
    ],
)
def test_invalid_height_maps_are_refused(options: dict, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        specification(**options)


def test_a_rollout_of_a_height_map_warns(monkeypatch) -> None:
    monkeypatch.setattr(hooks, "_given_rollout_warnings", set())
    model = specification().compile()
    state = np.zeros((1, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    with pytest.warns(RippleWarning, match="has no samples of 'map'"):
        rollout.rollout(model, mujoco.MjData(model), state, nstep=2)
