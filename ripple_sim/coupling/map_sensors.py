"""`add_height_map`: the heights of a surface as an image, which MuJoCo's simulate shows.

simulate shows a user sensor as an image if `sensor_intprm` is [width, height, 0] and the sensor has
3 width height numbers: sRGB from 0 to 255, rows from the bottom up. The last number is no colour.
simulate takes the image where this number has changed and is not 0.

As for `add_sensor`, a `<tuple>` in the specification names the sensor and the target, so that both
outlive XML. Its numbers are limit, rate, width and height. MuJoCo's XML does not keep the integer
parameters of user sensors: `Ripples` sets them again in the model.
"""

from __future__ import annotations

import dataclasses
import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import is_finite, shown, whole

from .ids import TargetId
from .sensor_tuples import (
    MAP_TUPLE,
    add_tuple,
    names_sensor_and_target,
    require_free_name,
    target_with_id,
    tuples_of,
    type_of_target,
)
from .target_waves import TargetWaves

_OBJECT = mujoco.mjtObj

# Largest side of an image [pixels].
_MAX_SIDE = 2048
_SIDE = whole(1)

# sRGB of heights of -limit, 0 and +limit, and of pixels without a surface.
_COLORS = np.array([[42.0, 78.0, 158.0], [244.0, 244.0, 242.0], [178.0, 40.0, 30.0]])
_BACKGROUND = 40.0

# Heights are coloured in so many steps on either side of 0.
_COLOR_STEPS = 128

# The number that tells simulate of a new image begins anew after so many images.
_MAX_VERSION = 1_000_000


@dataclasses.dataclass(frozen=True)
class MapSensor:
    """An image that `add_height_map` has added to a model.

    Attributes
    ----------
    name : str
    target : TargetId
    limit : float
        [m]
    rate : float
        Images a second [1/s].
    width, height : int
        [pixels]
    begin : int
        Its place in `data.sensordata`.
    """

    name: str
    target: TargetId
    limit: float
    rate: float
    width: int
    height: int
    begin: int


def add_height_map(
    spec: mujoco.MjSpec,
    name: str,
    geom: str,
    limit: float,
    width: int = 144,
    height: int = 96,
    rate: float = 30.0,
) -> mujoco.MjsSensor:
    """Add an image of a surface's heights, which `Ripples` writes to `data.sensordata`.

    MuJoCo's simulate and its viewer show the image in place of the bars of the sensors. The charts
    of the atlas lie side by side, row by row. Blue is -limit, white 0, red +limit.

    `data.sensor(name).data` has the colours as numbers from 0 to 255, [height, width, 3], the
    lowest row first. The last number counts the images.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Changed in place, before it is compiled.
    name : str
        Name of the sensor.
    geom : str
        Name of the geom, flex or skin that ripples.
    limit : float
        Height at which the colours end [m].
    width : int
        Of the image [pixels].
    height : int
        Of the image [pixels].
    rate : float
        Images a second of simulated time [1/s].

    Returns
    -------
    mujoco.MjsSensor

    Raises
    ------
    SceneError
        For an unknown geom, a name that is taken, or an invalid number.
    """
    require_free_name(spec, name)
    for key, value in (("limit", limit), ("rate", rate)):
        if not (is_finite(value) and value > 0):
            raise SceneError(
                f"{key} of a height map must be a number greater than 0, got {shown(value)}"
            )
    for key, side in (("width", width), ("height", height)):
        if not (_SIDE.holds(side) and side <= _MAX_SIDE):
            raise SceneError(
                f"{key} of a height map must be a whole number from 1 to {_MAX_SIDE}, got "
                f"{shown(side)}"
            )
    kind = type_of_target(spec, geom)
    sensor = spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_USER,
        dim=3 * width * height,
        intprm=[width, height, 0],
        datatype=mujoco.mjtDataType.mjDATATYPE_REAL,
        needstage=mujoco.mjtStage.mjSTAGE_NONE,
    )
    add_tuple(
        spec,
        MAP_TUPLE + name,
        [_OBJECT.mjOBJ_SENSOR, kind, _OBJECT.mjOBJ_SENSOR, _OBJECT.mjOBJ_SENSOR],
        [name, geom, name, name],
        [limit, rate, width, height],
    )
    return sensor


def map_sensors(model: mujoco.MjModel) -> list[MapSensor]:
    """The images that `add_height_map` has added to a model; sets their `sensor_intprm`.

    Raises `SceneError` if the tuple of one has been changed.
    """
    sensors = []
    for name, elements in tuples_of(model, MAP_TUPLE):
        types = model.tuple_objtype[elements].tolist()
        numbers = model.tuple_objprm[elements].tolist()
        ids = model.tuple_objid[elements].tolist()
        is_whole = len(types) == 4 and names_sensor_and_target(model, elements)
        if not is_whole or not _has_room(model, ids[0], numbers):
            raise SceneError(
                f"tuple {name!r} must have a user sensor and a geom, flex or skin, with limit, "
                "rate, width and height, as add_height_map makes it; give tuples of your own "
                "another name"
            )
        sensor = ids[0]
        width = int(numbers[2])
        height = int(numbers[3])
        model.sensor_intprm[sensor] = [width, height, 0]
        sensors.append(
            MapSensor(
                name=model.sensor(sensor).name,
                target=target_with_id(model, types[1], ids[1]),
                limit=numbers[0],
                rate=numbers[1],
                width=width,
                height=height,
                begin=int(model.sensor_adr[sensor]),
            )
        )
    return sensors


def _has_room(model: mujoco.MjModel, sensor: int, numbers: list[float]) -> bool:
    """Whether a sensor has room for an image with limit, rate, width and height."""
    return min(numbers) > 0 and model.sensor_dim[sensor] == 3 * numbers[2] * numbers[3]


class HeightImage:
    """Draws the heights of a surface into the place of a sensor."""

    def __init__(self, sensor: MapSensor, waves: TargetWaves) -> None:
        self.sensor = sensor
        self._lay_out(waves.height.shape)
        steps = np.linspace(-1.0, 1.0, 2 * _COLOR_STEPS + 1)
        table = [np.interp(steps, [-1.0, 0.0, 1.0], channel) for channel in _COLORS.T]
        self._table = np.rint(np.stack(table, axis=1))
        self.clear(None)

    def clear(self, data: mujoco.MjData | None) -> None:
        """Begin anew, with zeros in the data: the next step has an image."""
        self._version = 0
        self._shown = -1
        if data is not None:
            end = self.sensor.begin + 3 * self._texels.size
            data.sensordata[self.sensor.begin : end] = 0.0

    def _lay_out(self, shape: tuple[int, ...]) -> None:
        """Find the texel of each pixel, for charts [C, n, n]."""
        self._shape = shape
        self._texels = texels_of_pixels(self.sensor, shape)

    def draw(self, waves: TargetWaves, data: mujoco.MjData) -> None:
        """Write an image, if one is due by now."""
        number = math.floor(data.time * self.sensor.rate)
        if number == self._shown:
            return
        self._shown = number
        self._version = self._version % _MAX_VERSION + 1
        heights = waves.height
        if heights.shape != self._shape:  # the surface got another atlas
            self._lay_out(heights.shape)
        share = np.clip(heights.reshape(-1) / self.sensor.limit, -1.0, 1.0)
        colors = self._table[np.rint(_COLOR_STEPS * (1.0 + share)).astype(np.int64)]
        image = np.where(self._texels[..., None] >= 0, colors[self._texels], _BACKGROUND)
        begin = self.sensor.begin
        end = begin + image.size
        data.sensordata[begin:end] = image[::-1].reshape(-1)
        data.sensordata[end - 1] = self._version


def texels_of_pixels(sensor: MapSensor, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Flat index of the texel at each pixel [height, width], top row first; -1 without a texel.

    Raises `SceneError` if a chart of the `shape` [C, n, n] would have no pixel.
    """
    charts, n, _ = shape
    columns = min(charts, max(1, round(math.sqrt(charts * sensor.width / sensor.height))))
    side = min(sensor.width // columns, sensor.height // math.ceil(charts / columns))
    if side < 1:
        raise SceneError(
            f"height map {sensor.name!r} must have a pixel or more for each of {charts} charts, "
            f"got {sensor.width} x {sensor.height} pixels; take a larger image, or a coarser "
            "resolution"
        )
    y, x = np.indices((sensor.height, sensor.width))
    chart = (y // side) * columns + x // side
    row = (y % side) * n // side
    column = (x % side) * n // side
    is_inside = (x // side < columns) & (chart < charts)
    return np.where(is_inside, (chart * n + row) * n + column, -1)
