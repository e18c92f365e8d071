"""Sound: the pressure that rippling surfaces make at a place in the air, by Rayleigh's integral.

p(x, t) = rho_0 / (2 pi) integral of a(y, t - r / c_0) / r over the surface, with a the acceleration
along the outward normal and r the way from y to x (Rayleigh 1896, section 278). It holds for plane
surfaces in a rigid wall; here texels that face away are left out instead. No air loads the surface,
and there is no room.

Texels of one delay act together: they are one sum of `Probes` after every substep, a texel on the
two delays between which its own lies. The sums of all delays are added up late, each by its delay,
in whole substeps. A place that moves is interpolated to every sample; see `Ear`.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.capture.scene_camera import viewpoint
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.coupling.soft import target_pose
from ripple_sim.encode.replace import MARK
from ripple_sim.encode.webp import riff_chunk
from ripple_sim.simulation import Simulation
from ripple_sim.solver import WaveSolver
from ripple_sim.solver.backends.probes import Probes
from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.files import atomic_write
from ripple_sim.solver.kernel import Floats, Ints
from ripple_sim.solver.waves.finite import count_substeps
from ripple_sim.solver.waves.sensor import filtered, hertz, trusted_frequency

# of dry air at 20 degrees Celsius [kg/m^3]
DENSITY = 1.204

# of sound in dry air at 20 degrees Celsius [m/s]
SPEED = 343.2

# samples a second of the sound file [1/s]
RATE = 48_000

# Highest level over full scale: codecs may overshoot a little.
_PEAK_LEVEL = 0.9

# [Hz]: lowest audible tone
_LOWEST_AUDIBLE = 20.0

# Size of a surface over the shortest wavelength that counts as a long wave.
_SIZE_OVER_WAVELENGTH = 5.0

# Cosine of the direction from which on a texel counts in full. Below it the weight falls to 0, so
# that no texel appears at once.
_FULL_WEIGHT_COSINE = 0.1

# [m]: nearer texels count as if they were at this distance
_MIN_DISTANCE = 0.01

# [m]: a listener that moves by less stays in place
_MIN_MOVE = 1e-6


class Microphone:
    """Hears the ripples of a model from a place that may move.

    Parameters
    ----------
    ripples : Ripples
    slow_motion : float
        Seconds of sound per second of the simulation: it is lower and longer by this.

    Attributes
    ----------
    rate : float
        Samples for each second of the simulation [1/s].
    """

    def __init__(self, ripples: Ripples, slow_motion: float = 1.0) -> None:
        self.rate = RATE * slow_motion
        self._ripples = ripples
        self._ears = {name: Ear(ripples[name], ripples.model.opt.timestep) for name in ripples}
        for name in ripples:
            # long waves may be too slow to be heard
            material = ripples[name].material
            atlas = ripples[name].atlas
            size = float(np.ptp(atlas.positions.reshape(-1, 3), axis=0).max())
            texels = range(0, atlas.areas.size, 97)
            highest = (
                max(hertz(material, texel, size / _SIZE_OVER_WAVELENGTH) for texel in texels)
                / slow_motion
            )
            if highest < _LOWEST_AUDIBLE:
                ringing = 200 * size / 0.77 * slow_motion
                warn_caller(
                    f"{name!r} is hardly heard: waves of {size / _SIZE_OVER_WAVELENGTH:.2g} m and "
                    f"longer sound at {highest:.2g} Hz at most, below hearing "
                    f"({_LOWEST_AUDIBLE:g} Hz); a speed of {ringing:.2g} m/s would ring at 200 Hz"
                )

    @property
    def bandwidth(self) -> float:
        """Frequency [Hz] up to which the sound can be trusted, as a sensor's `bandwidth`.

        It is that of the widest texels, in samples for each second of the simulation.
        """
        limits = []
        for name, ear in self._ears.items():
            waves = self._ripples[name]
            widest = [int(waves.rest.areas.argmax())]
            rate = min(self.rate, 1 / ear.substep)
            limits.append(trusted_frequency(waves.rest, waves.material, widest, rate))
        return min(limits)

    def place(self, data: mujoco.MjData, point: NDArray[np.float64]) -> None:
        """Move to a point in the world [m], [3].

        Call it again when the point or a target has moved.
        """
        for name, geom in self._ripples.geom_ids.items():
            position, rotation = target_pose(data, geom)
            self._ears[name].stand(self._ripples[name], (point - position) @ rotation)

    def follow(self, simulation: Simulation) -> None:
        """Stand where the scene's camera is now."""
        data = simulation.data
        self.place(
            data,
            viewpoint(simulation.model, data, simulation.scene.camera, data.time).pose().position,
        )

    def pressure(self, duration: float) -> NDArray[np.float64]:
        """The pressure [k] [Pa] from time 0 over a duration of the simulation [s].

        k is the rate times the duration.
        """
        at = np.arange(round(self.rate * duration)) / self.rate
        return sum((ear.heard(at, self.rate) for ear in self._ears.values()), np.zeros(len(at)))


class Placement(NamedTuple):
    """How a surface is heard from one place.

    Attributes
    ----------
    probes : Probes
        The sums of texels that act together.
    delays : int64 [k]
        By which each of them comes late, in substeps, less what is common to all; see `Ear`.
    """

    probes: Probes
    delays: Ints


class Ear:
    """A listener to one target, from a place that may move.

    What a texel gives is heard r / c_0 later, with r the way from it. Most of that is the way from
    the surface's middle, which changes from sample to sample as the place moves: `heard` takes it
    off where the samples are made. So tones rise and fall as they should (Doppler). What a texel's
    own way differs by is in the `Placement`. Over the time between two placements sound fades from
    the one before the last to the last, so that nothing jumps.

    Parameters
    ----------
    waves : WaveSolver
    timestep : float
        Of the steps that the waves take [s].

    Attributes
    ----------
    substep : float
        Of the waves [s].
    """

    def __init__(self, waves: WaveSolver, timestep: float) -> None:
        self.substep = timestep / count_substeps(timestep, waves.stable_timestep, None)
        self._series = np.zeros(0)  # what is heard at the surface's middle, one value a substep
        self._now: Placement | None = None
        self._before: Placement | None = None
        # times of the placements [s], and the ways from the surface's middle [m]
        self._times: list[float] = []
        self._ways: list[Floats] = []
        # no texel is further from the middle, even of a surface that stretches [m]
        places = waves.atlas.positions.reshape(-1, 3)
        self._reach = 2 * float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())

    def stand(self, waves: WaveSolver, here: NDArray[np.float64]) -> None:
        """Move to a place in the target's frame [m].

        Between two calls the place moves on a straight line.
        """
        middle = waves.atlas.positions.reshape(-1, 3).mean(axis=0)
        way = here - middle
        has_moved = not self._ways or bool(np.abs(way - self._ways[-1]).max() >= _MIN_MOVE)
        self._times.append(waves.time)
        self._ways.append(way)
        if not (has_moved or waves.vertices is not None or self._before is not None):
            return
        self._before = self._now
        if has_moved or waves.vertices is not None:
            self._now = self._placement(waves, here, float(np.linalg.norm(way)))
        else:
            self._before = None  # it has faded
        used = [each for each in (self._before, self._now) if each is not None]
        self.probes = Probes.together([each.probes for each in used])
        self._delays = np.concatenate([each.delays for each in used])
        waves.listeners.use([each for each in waves.listeners.all if each is not self])
        waves.listeners.add(self, waves.time)

    def begin(self, time: float, values: NDArray) -> None:
        """Begin with the sums of velocities now; after a reset time has gone back."""
        self._last = values
        self._times = [min(each, time) for each in self._times]

    def take(self, time: float, dt: float, sums: NDArray[np.float32]) -> None:
        """Add what the substeps of dt [s] from a time on give, later by their delays."""
        changes = np.diff(sums.astype(np.float64), axis=0, prepend=self._last[None]) / self.substep
        self._last = sums[-1].astype(np.float64)
        # a change happens in the middle of its substep, and so do the series' entries
        middles = time + dt * (np.arange(len(sums)) + 0.5)
        when = middles / self.substep - 0.5
        if self._before is not None:
            count = len(self._before.delays)
            faded = self._faded(middles)[:, None]
            changes[:, :count] *= 1 - faded
            changes[:, count:] *= faded
        size = int(when[-1] + self._delays.max()) + 3
        if size > len(self._series):
            self._series = np.append(
                self._series, np.zeros(max(size, 2 * len(self._series)) - len(self._series))
            )
        if abs(dt - self.substep) < 1e-9 * dt:
            first = round(when[0])
            each = np.ascontiguousarray(changes.T)
            for delay, change in zip((first + self._delays).tolist(), each, strict=True):
                self._series[delay : delay + len(change)] += change
        else:
            # the material changed, and with it the length of a substep: a change of pressure
            # lies between two entries
            whole = np.maximum(np.floor(when), 0).astype(np.int64)
            late = (when - whole)[:, None]
            places = whole[:, None] + self._delays
            np.add.at(self._series, places, changes * (1 - late))
            np.add.at(self._series, places + 1, changes * late)

    def heard(self, at: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
        """The pressure at given times [s], filtered for samples at a rate [1/s].

        It is 0 if `stand` was never called.
        """
        if not self._ways or not len(at):
            return np.zeros(len(at))
        ways = np.stack(
            [np.interp(at, self._times, each) for each in np.transpose(self._ways)], axis=1
        )
        left_at = at - (np.linalg.norm(ways, axis=1) - self._reach) / SPEED
        reach = np.zeros(max(len(self._series), int(left_at.max() / self.substep) + 2) + 64)
        reach[: len(self._series)] = self._series
        times = (np.arange(len(reach)) + 0.5) * self.substep
        base = min(rate, 1 / self.substep)
        # nothing is heard before the beginning
        begun = left_at > times[0]
        pressure = np.zeros(len(at))
        if begun.any():
            spans = np.full(len(times), self.substep)
            heard = filtered(times, spans, reach[:, None], left_at[begun], base)
            pressure[begun] = heard[:, 0]
        return pressure

    def _placement(self, waves: WaveSolver, here: Floats, common: float) -> Placement:
        """The placement for a place in the target's frame [m].

        `common` is the distance from the surface's middle [m], by which all delays are reduced.
        """
        atlas = waves.atlas
        way = here - atlas.positions.reshape(-1, 3)
        distance = np.maximum(np.linalg.norm(way, axis=1), _MIN_DISTANCE)
        cosine = np.einsum("ij,ij->i", way, atlas.normals.reshape(-1, 3)) / distance
        weight = (
            DENSITY
            / (2 * np.pi)
            * atlas.areas.reshape(-1)
            / distance
            * np.clip(cosine / _FULL_WEIGHT_COSINE, 0, 1)
        )
        texels = np.flatnonzero(weight * waves.operator.movable.reshape(-1))
        if not len(texels):
            texels = np.zeros(1, np.int64)  # it faces away everywhere: a texel without weight
        every = max(1, int(1 / (2 * RATE * self.substep)))  # substeps from one delay to the next
        own = np.maximum(distance[texels] - common + self._reach, 0.0)
        delay = own / SPEED / (every * self.substep)
        first = np.floor(delay).astype(np.int64)
        slots = np.concatenate([first, first + 1])
        late = delay - first
        shares = np.concatenate([(1 - late) * weight[texels], late * weight[texels]])
        order = np.argsort(slots, kind="stable")
        delays, begins = np.unique(slots[order], return_index=True)
        probes = Probes(
            np.append(begins, len(slots)),
            np.concatenate([texels, texels])[order],
            shares[order].astype(np.float32),
            np.zeros(len(begins), np.bool_),
        )
        return Placement(probes, every * delays)

    def _faded(self, times: NDArray) -> NDArray:
        """Share of the last placement in the sound at given times [s], [k].

        It rises from 0 to 1 over the time that the placement before lasted.
        """
        span = self._times[-1] - self._times[-2]
        return (
            np.clip((times - self._times[-1]) / span, 0.0, 1.0) if span > 0 else np.ones(len(times))
        )


def gain(pressure: NDArray[np.float64]) -> float:
    """By what a pressure [Pa] is multiplied so that it just does not clip."""
    peak = float(np.abs(pressure).max(initial=0.0))
    return _PEAK_LEVEL / peak if peak > 0 else 1.0


def scale_note(signals: NDArray, unit: str, bandwidth: float) -> str:
    """What a sample of a sound file means, and up to which frequency [Hz] it is right."""
    if not signals.any():
        return "silent"
    return f"a sample of 1 is {1 / gain(signals):.3g} {unit}, trusted up to {bandwidth:.3g} Hz"


def write_wav(path: Path, signals: NDArray, rate: int) -> None:
    """Write signals [k] or [k, channels] between -1 and 1 to a 16-bit WAV file with our mark."""
    codes = np.rint(np.clip(signals, -1, 1) * 32767).astype("<i2")
    channels = 1 if codes.ndim == 1 else codes.shape[1]
    mark = MARK.encode() + b"\0" * (2 - len(MARK) % 2)
    form = struct.pack("<HHIIHH", 1, channels, rate, 2 * channels * rate, 2 * channels, 16)
    comment = b"INFO" + riff_chunk(b"ICMT", mark)
    parts = ((b"fmt ", form), (b"LIST", comment), (b"data", codes.tobytes()))
    content = b"WAVE" + b"".join(riff_chunk(*part) for part in parts)
    with atomic_write(path) as unfinished:
        unfinished.write_bytes(riff_chunk(b"RIFF", content))
