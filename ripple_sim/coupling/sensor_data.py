"""`SensorData` writes the samples of a model's sensors on rippling surfaces to its data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.waves.sensor import Sensor

from .ids import TargetId
from .map_sensors import HeightImage, map_sensors
from .rippling import site_on
from .target_waves import TargetWaves
from .user_sensors import user_sensors

# Share of a sample by which a latency may exceed a whole number of samples.
_ROUND_OFF = 1e-6


class SampleBlocks:
    """Blocks of a sensor's samples, each as long as a step: one unbroken row from step to step.

    A block begins with the sample at the beginning of its step, late by `latency`.

    Parameters
    ----------
    sensor : Sensor
        It is read here alone.
    count : int
        Samples in a block.

    Attributes
    ----------
    late : int
        The sensor's latency, rounded up to whole samples.
    """

    def __init__(self, sensor: Sensor, count: int) -> None:
        self.sensor = sensor
        self.count = count
        self.late = math.ceil(sensor.latency * sensor.rate - _ROUND_OFF)
        self.clear()

    def clear(self) -> None:
        """Forget all samples."""
        self._numbers = np.zeros(0, np.int64)
        self._values = np.zeros((0, len(self.sensor.points)), np.float32)

    def latest(self) -> NDArray[np.float32]:
        """The block of the latest step, [count, points].

        Samples from before the sensor began are 0.
        """
        self._read()
        first = round(self.sensor.time * self.sensor.rate) - self.late - self.count
        is_needed = self._numbers >= first
        self._numbers = self._numbers[is_needed]
        self._values = self._values[is_needed]
        places = self._numbers - first
        is_inside = places < self.count
        block = np.zeros((self.count, self._values.shape[1]), np.float32)
        block[places[is_inside]] = self._values[is_inside]
        return block

    def _read(self) -> None:
        """Take the sensor's new samples, by their numbers since time 0."""
        times, values = self.sensor.read()
        if not len(times):
            return
        numbers = np.rint(times * self.sensor.rate).astype(np.int64)
        # after a step back in time, samples of later times belong to the past
        is_before = self._numbers < numbers[0]
        self._numbers = np.concatenate([self._numbers[is_before], numbers])
        self._values = np.concatenate([self._values[is_before], values])


class SensorData:
    """The sensors of a model that `add_sensor` has added, and their place in `data.sensordata`.

    A pickled or copied one begins anew, as sensors do.

    Attributes
    ----------
    sensors : dict of str to Sensor
    """

    def __init__(self, model: mujoco.MjModel, waves: Mapping[TargetId, TargetWaves]) -> None:
        self._model = model
        self._waves = waves
        self._timestep = float(model.opt.timestep)
        self.sensors: dict[str, Sensor] = {}
        # with their place in `sensordata`
        self._blocks: list[tuple[slice, SampleBlocks]] = []
        for record in user_sensors(model):
            if record.target not in waves:
                warn_caller(
                    f"sensor {record.name!r} is on {record.geom!r}, which does not ripple, and "
                    "stays 0; give it a material in Ripples(model, materials)"
                )
                continue
            point = site_on(model, record.target, record.site)
            sensor = waves[record.target].sensor(
                point, record.kind, record.rate, thickness=record.thickness
            )
            self.sensors[record.name] = sensor
            place = slice(record.begin, record.end)
            blocks = SampleBlocks(sensor, record.end - record.begin)
            self._blocks.append((place, blocks))
        self._images: list[HeightImage] = []
        for image in map_sensors(model):
            if image.target in waves:
                self._images.append(HeightImage(image, waves[image.target]))
            else:
                warn_caller(
                    f"height map {image.name!r} is of a geom that does not ripple, and stays 0; "
                    "give the geom a material in Ripples(model, materials)"
                )

    def __reduce__(self) -> tuple[Any, ...]:
        return SensorData, (self._model, self._waves)

    def timestep_warning(self) -> str | None:
        """Warning of a time step that the sensors' blocks do not fit; None if they fit."""
        timestep = float(self._model.opt.timestep)
        if not self.sensors or timestep == self._timestep:
            return None
        lost = "lack samples" if timestep > self._timestep else "repeat samples"
        return (
            f"the model's time step was changed from {self._timestep:g} to {timestep:g} s: sensors "
            f"of add_sensor have room for the samples of {self._timestep:g} s, and their blocks in "
            f"sensordata {lost} from now on; set spec.option.timestep before add_sensor"
        )

    def write(self, data: mujoco.MjData) -> None:
        """Write the samples of the latest step."""
        for place, blocks in self._blocks:
            data.sensordata[place] = blocks.latest()[:, 0]
        for image in self._images:
            image.draw(self._waves[image.sensor.target], data)

    def clear(self, data: mujoco.MjData | None) -> None:
        """Forget all samples, and write zeros."""
        for place, blocks in self._blocks:
            blocks.clear()
            if data is not None:
                data.sensordata[place] = 0.0
        for image in self._images:
            image.clear(data)
