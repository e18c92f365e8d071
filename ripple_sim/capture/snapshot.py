"""Copies of the state of a running simulation, one for each exposure of a frame.

`exposures_of` gives the times of the exposures while the shutter is open, and their points of the
lens. `ShutterTimes` takes the simulation to these times, also between its physics steps, and
`drawn_heights` makes height maps.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
from collections.abc import Callable, Iterable, Iterator
from typing import TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ripples import Impulse, Ripples
from ripple_sim.render.height_map_textures import AnyHeightMap, MovedHeightMap
from ripple_sim.scene.camera_entry import CameraEntry
from ripple_sim.simulation import Simulation
from ripple_sim.solver import HeightMap
from ripple_sim.solver.backends.gl_fields import DeviceField
from ripple_sim.solver.waves.motion import MovedGradients

Field: TypeAlias = NDArray[np.float32] | DeviceField
Heights = dict[str, Field]

# Decimals of times in physics steps: a time that is off a whole step by round-off is rounded to it.
_STEP_DECIMALS = 9

# The multiples of this number are spread evenly modulo 1.
_GOLDEN_RATIO = (np.sqrt(5.0) - 1.0) / 2.0

# Angle of a rotary shutter that is open all the time from frame to frame [degrees].
_FULL_TURN = 360.0


class ShutterTimes:
    """States of a simulation at given times of each frame.

    Iterating over it advances the simulation through the times of the present frame. It takes the
    same physics steps as without a shutter, so motion blur does not change the motion. Within a
    step, states are interpolated between its ends: bodies move at constant velocity, as in MuJoCo's
    Euler and implicit integrators, and heights linearly.

    Parameters
    ----------
    times : float64 [n]
        In frames from a frame's beginning, ascending, from 0 to 1.
    """

    def __init__(self, simulation: Simulation, times: NDArray[np.float64]) -> None:
        self._simulation = simulation
        self._times_in_steps = np.round(times * simulation.steps_per_frame, _STEP_DECIMALS).tolist()
        self._start = mujoco.MjData(simulation.model)
        self._between = mujoco.MjData(simulation.model)

    def __iter__(self) -> Iterator[tuple[mujoco.MjData, Heights]]:
        """Advance to one time after the other.

        Yields
        ------
        data : mujoco.MjData
            State of the bodies, until the next iteration.
        heights : dict
            By the geom's name [m], float32 [C, n, n], or on the GPU, see `WaveSolver.snapshot`. The
            same object as before where no time has passed.
        """
        simulation = self._simulation
        steps_taken = 0
        heights_now = self._heights()
        heights_before = heights_now
        for time in self._times_in_steps:
            while steps_taken < time:
                mujoco.mj_copyData(self._start, simulation.model, simulation.data)
                simulation.step()
                steps_taken += 1
                heights_before = heights_now
                heights_now = self._heights()
            steps_back = steps_taken - time
            if steps_back == 0:
                yield simulation.data, heights_now
            else:
                self._go_back(steps_back * simulation.model.opt.timestep)
                heights = {
                    name: _blend(height, heights_before[name], steps_back)
                    for name, height in heights_now.items()
                }
                yield self._between, heights

    def _heights(self) -> Heights:
        """The present heights of all targets."""
        ripples = self._simulation.ripples
        return {name: ripples[name].snapshot() for name in ripples}

    def _go_back(self, duration: float) -> None:
        """Set the bodies to where they were a duration [s] ago, within the last step.

        After `mj_step` the poses in MuJoCo's data are the ones at the beginning of the step. The
        same holds for the poses set here: the bodies came there by the motion of the step before.
        """
        model = self._simulation.model
        data = self._between
        mujoco.mj_copyData(data, model, self._start)
        data.time = self._simulation.data.time - duration
        mujoco.mj_integratePos(model, data.qpos, data.qvel, -duration)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_flex(model, data)
        mujoco.mj_camlight(model, data)


def _blend(first: Field, second: Field, share: float) -> Field:
    """The first field, or the second one where `share` is 1, or linearly between the two."""
    if isinstance(first, DeviceField):
        return first.blend(second, share) if isinstance(second, DeviceField) else first
    return first + np.float32(share) * (second - first)


def drawn_heights(
    ripples: Ripples, name: str, limit: bool
) -> Callable[[Field, mujoco.MjData], AnyHeightMap]:
    """A function that makes height maps of a target's heights [C, n, n] [m].

    Where the vertices of the target's mesh have moved, the height map contains their positions.

    Parameters
    ----------
    name : str
        Of the target.
    limit : bool
        Whether heights that are too large for the object are bent, see `DisplacementLimit`.
    """
    at_rest = HeightMap.drawn(ripples[name].rest, limit)
    gradients = functools.cache(lambda: MovedGradients(ripples[name].rest))

    def drawn(height: Field, data: mujoco.MjData) -> AnyHeightMap:
        height_map = at_rest(height)
        V = ripples.vertices(name, data)
        if V is None:
            return height_map
        return MovedHeightMap(gradients()(np.asarray(height_map), V), V)

    return drawn


def exposures_of(camera: CameraEntry) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and lens points of the exposures whose mean is a frame, in the order of time.

    They are the same for every frame. Without shutter and aperture there is a single exposure,
    through the middle of the lens.

    Returns
    -------
    times : float64 [n]
        In frames after the frame's own time, when the shutter opens. The first is 0.
    offsets : float64 [n, 2]
        Point of the lens, to the right and up of its middle [m].
    """
    count = camera.exposures if camera.shutter > 0 or camera.aperture > 0 else 1
    times = camera.shutter / _FULL_TURN * np.arange(count) / count
    # any part of the time sees all parts of the lens: with points from the middle outwards, moving
    # bodies would begin sharp and end blurred
    order = np.argsort(np.argsort(np.arange(count) * _GOLDEN_RATIO % 1.0))
    return times, camera.aperture / 2 * disc_points(count)[order]


def disc_points(count: int) -> NDArray[np.float64]:
    """Points spread evenly over the unit disc, float64 [count, 2], with their mean in its middle.

    A spiral whose points follow one another under the golden angle (Vogel, "A better way to
    construct the sunflower head", Mathematical Biosciences 44, 1979).
    """
    index = np.arange(count)
    radius = np.sqrt((index + 0.5) / count)
    angle = 2 * np.pi * _GOLDEN_RATIO * index
    points = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return points - points.mean(axis=0)


@dataclasses.dataclass(frozen=True, eq=False)
class Snapshot:
    """The state of a simulation at one exposure of a frame; it does not follow the simulation.

    Attributes
    ----------
    number : int
        Of the frame, from 0.
    exposure : int
        Number of the exposure within its frame. Exposure 0 is at the frame's own time, when the
        shutter opens.
    data : mujoco.MjData
        Copy of MuJoCo's state.
    heights, height_maps : dict
        By the geom's name: height [m], float32 [C, n, n], and its height map (see `HeightMap`).
        Where the waves run on a GPU both stay there, and `numpy.asarray` reads them back.
    impulses : list of Impulse
        Since the frame before, up to the frame's own time.
    """

    number: int
    exposure: int
    data: mujoco.MjData
    heights: Heights
    height_maps: dict[str, AnyHeightMap]
    impulses: list[Impulse]

    def digest(self) -> str:
        """Fingerprint of the state of bodies and waves: the same if and only if every bit is."""
        return state_digest(self.data, map(np.asarray, self.heights.values()))


def state_digest(data: mujoco.MjData, heights: Iterable[NDArray[np.float32]]) -> str:
    """Fingerprint of the state of bodies and of the heights of all waves."""
    hasher = hashlib.blake2b(digest_size=16)
    for array in (data.qpos, data.qvel, data.act, *heights):
        hasher.update(array.tobytes())
    return hasher.hexdigest()


def snapshots(simulation: Simulation, frames: int, *, alive: int = 1) -> Iterator[Snapshot]:
    """Advance a simulation frame by frame; yield a snapshot for each exposure of its camera.

    Parameters
    ----------
    simulation : Simulation
        At its beginning, which is frame 0.
    frames : int
        Number of frames.
    alive : int
        Number of the latest snapshots that stay valid; older ones are overwritten.
    """
    states = itertools.cycle([mujoco.MjData(simulation.model) for _ in range(alive)])
    ripples = simulation.ripples
    drawn = {name: drawn_heights(ripples, name, simulation.limited[name]) for name in ripples}
    shutter_times = ShutterTimes(simulation, exposures_of(simulation.scene.camera)[0])
    for number in range(frames):
        if number:
            simulation.advance_frame()
        impulses = simulation.impulses
        latest_heights = None
        for exposure, (state, heights) in enumerate(shutter_times):
            if heights is not latest_heights:  # time has passed
                data = next(states)
                latest_heights = heights
                mujoco.mj_copyData(data, simulation.model, state)
                height_maps = {name: drawn[name](height, data) for name, height in heights.items()}
            yield Snapshot(number, exposure, data, heights, height_maps, impulses)
