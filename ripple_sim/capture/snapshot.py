"""Frozen copies of a running simulation's state, one for each exposure of a frame."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
from collections.abc import Iterable, Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.render.height_maps import AnyHeightMap
from ripple_sim.simulation import Simulation

from .drawn_heights import DrawnHeights
from .exposure import Exposures
from .shutter import Heights, ShutterTimes


@dataclasses.dataclass(frozen=True, eq=False)
class Snapshot:
    """A simulation's state at one exposure of a frame, which stays as it is while the simulation goes on.

    Attributes
    ----------
    number : int
        Of the frame, from 0.
    exposure : int
        Of the frame's exposures, from 0, which is at the frame's own time: when the shutter opens.
    data : mujoco.MjData
        Copy of MuJoCo's state.
    heights, height_maps : dict
        By the geom's name: height [m], float32 [C, n, n], and its height map (see `HeightMap`). Where the waves run on
        a GPU both stay there, and `numpy.asarray` reads them back.
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
    """Advance a simulation frame by frame, through the exposures of each frame that its camera takes.

    Parameters
    ----------
    simulation : Simulation
        At its beginning, which is frame 0.
    frames : int
        How many.
    alive : int
        How many of the latest snapshots are in use at a time; older ones are overwritten.
    """
    states = itertools.cycle([mujoco.MjData(simulation.model) for _ in range(alive)])
    ripples = simulation.ripples
    drawn = {name: DrawnHeights(ripples, name, simulation.limited[name]) for name in ripples}
    shutter_times = ShutterTimes(simulation, Exposures.of(simulation.scene.camera).times)
    for number in range(frames):
        if number:
            simulation.advance_frame()
        impulses, shown = simulation.impulses, None
        for exposure, (state, heights) in enumerate(shutter_times):
            if heights is not shown:
                data, shown = next(states), heights
                mujoco.mj_copyData(data, simulation.model, state)
                height_maps = {name: drawn[name](height, data) for name, height in heights.items()}
            yield Snapshot(number, exposure, data, heights, height_maps, impulses)
