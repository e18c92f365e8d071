"""Signals as a .wav file: of a scene's sensors, or of a microphone at the camera."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.encode.replace import MARK
from ripple_sim.errors import ExportError
from ripple_sim.solver.waves.sensor import UNITS
from ripple_sim.sound import Microphone, gain, scale_note, write_wav

from .source import Source, Writer


class WavWriter(Writer):
    """Writes one file of 16 bits a sample, with one gain for all channels; see `Writer`.

    Each point of a sensor has a channel. Slow motion makes the sound longer and lower.
    """

    def __init__(self, source: Source, path: Path) -> None:
        self._source = source
        self._path = path
        self._microphone = (
            None if source.sensors else Microphone(source.ripples, source.slow_motion)
        )
        if len({sensor.rate for sensor in source.sensors.values()}) > 1:
            rates = ", ".join(
                f"{name!r} {sensor.rate:g}" for name, sensor in source.sensors.items()
            )
            raise ExportError(
                f"the sensors of a .wav have one rate; these have {rates}: change them, or write "
                f".zarr"
            )
        self._frames = 0

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Hear the frame from where the camera stands."""
        if self._microphone is not None:
            self._microphone.place(data, self._source.pose(data).position)
        self._frames = number

    def finish(self) -> None:
        """Write all that was measured or heard."""
        source = self._source
        if self._microphone is not None:
            signals = self._microphone.pressure(self._frames / (source.fps * source.slow_motion))
            rate = self._microphone.rate
            unit = "Pa"
            bandwidth = self._microphone.bandwidth
        else:
            sampled = [sensor.samples for sensor in source.sensors.values()]
            # the last samples of sensors on coarser surfaces come later
            count = min(map(len, sampled))
            channels = [samples[:count] for samples in sampled]
            signals = np.concatenate(channels, axis=1).astype(np.float64)
            rate = next(iter(source.sensors.values())).rate
            units = [UNITS[sensor.kind] for sensor in source.sensors.values()]
            unit = " or ".join(dict.fromkeys(units))
            bandwidth = min(sensor.bandwidth for sensor in source.sensors.values())
        self.note = scale_note(signals, unit, bandwidth / source.slow_motion)
        write_wav(self._path, signals * gain(signals), round(rate / source.slow_motion))


def made_here(path: Path) -> bool:
    """Whether a file has the comment of one from here."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return MARK.encode() in file.read(200)
