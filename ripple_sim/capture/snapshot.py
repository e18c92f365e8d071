"""Frozen copies of a running simulation's state, one for each exposure of a frame.

`exposures_of` says at which times while the shutter is open, and through which points of the lens;
`ShutterTimes` takes the simulation there, between its physics steps, and `drawn_heights` makes
height maps, wherever a surface is. `ShownWaves` tells whether there is anything to be seen of the
waves.
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
from ripple_sim.render.pose import Pose
from ripple_sim.scene.scene_file import CameraEntry
from ripple_sim.simulation import Simulation
from ripple_sim.solver import HeightMap
from ripple_sim.solver.backends.gl_fields import DeviceField
from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.waves.motion import MovedGradients

Field: TypeAlias = NDArray[np.float32] | DeviceField
Heights = dict[str, Field]

_ROUNDING = 9  # decimals of a physics step: what is a whole step but for round-off is one

_SEEN = 5.0  # pixels of a height that catches the eye
_GOLDEN_RATIO = (np.sqrt(5.0) - 1.0) / 2.0
_FULL_TURN = 360.0  # degrees of a rotary shutter: open from one frame to the next


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
        # in physics steps
        self._places = np.round(times * simulation.steps_per_frame, _ROUNDING).tolist()
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
        done = 0
        before = now = self._heights()
        for place in self._places:
            while done < place:
                mujoco.mj_copyData(self._start, simulation.model, simulation.data)
                simulation.step()
                before = now
                now = self._heights()
                done += 1
            rest = done - place
            if rest == 0:
                yield simulation.data, now
            else:
                self._go_back(rest * simulation.model.opt.timestep)
                yield self._between, {name: _blend(now[name], before[name], rest) for name in now}

    def _heights(self) -> Heights:
        return {
            name: self._simulation.ripples[name].snapshot() for name in self._simulation.ripples
        }

    def _go_back(self, duration: float) -> None:
        """Set the bodies to where they were a duration [s] ago, within the last step.

        After `mj_step` MuJoCo's poses are those at the step's beginning. So are these, and the
        motion that led to them is the one of the step before.
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
    if isinstance(first, DeviceField):
        return first.blend(second, share) if isinstance(second, DeviceField) else first
    return first + np.float32(share) * (second - first)


def drawn_heights(
    ripples: Ripples, name: str, limit: bool
) -> Callable[[Field, mujoco.MjData], AnyHeightMap]:
    """What makes height maps of a target's heights [m], [C, n, n]; with the mesh's vertices, where these have moved.

    Parameters
    ----------
    name : str
        Of the target.
    limit : bool
        Whether heights that are too large for the object are bent, see `DisplacementLimit`.
    """
    still = HeightMap.drawn(ripples[name].rest, limit)
    gradients = functools.cache(lambda: MovedGradients(ripples[name].rest))

    def drawn(height: Field, data: mujoco.MjData) -> AnyHeightMap:
        height_map = still(height)
        V = ripples.vertices(name, data)
        return (
            height_map if V is None else MovedHeightMap(gradients()(np.asarray(height_map), V), V)
        )

    return drawn


class ShownWaves:
    """Takes note of how high waves are in pictures of a height [pixels], and warns of those that no picture shows."""

    def __init__(self, ripples: Ripples, height: int) -> None:
        self._ripples = ripples
        self._height = height
        # by target: of the highest wave so far in pixels, these, its height [m], and the width of a
        # pixel there [m]
        self._highest = dict.fromkeys(ripples, (0.0, 0.0, 1.0))

    def look(self, data: mujoco.MjData, heights: Heights, pose: Pose) -> None:
        """Take in a picture from a pose: the highest waves, in pixels of the nearest point that may be seen."""
        model = self._ripples.model
        for name, height in heights.items():
            geom = self._ripples.geom_ids[name]
            distance = pose.distance
            if geom < model.ngeom:  # what is soft has no place of its own
                away = float(np.linalg.norm(data.geom_xpos[geom] - pose.position)) - float(
                    model.geom_rbound[geom]
                )
                distance = max(away, 0.1 * distance)
            pixel = pose.pixel_height(distance, self._height)
            peak = height.peak if isinstance(height, DeviceField) else float(np.abs(height).max())
            self._highest[name] = max(self._highest[name], (peak / pixel, peak, pixel))

    def warn_of_low(self) -> None:
        """Warn of targets whose waves were there, but never higher than a pixel, and say what would do."""
        for name, (pixels, peak, pixel) in self._highest.items():
            if 0 < pixels < 1:
                density = np.asarray(self._ripples[name].material.density)
                factor = _SEEN / pixels
                lower = "" if density.ndim else f", {float(density) / factor:.2g} kg/m^2,"
                warn_caller(
                    f"no wave on {name!r} was higher than a pixel: {peak:.2g} m at most, where a "
                    f"pixel is {pixel:.2g} m"
                    f" wide. A density {factor:.2g} times lower{lower} would show {_SEEN:g} "
                    f"pixels; so may "
                    'material = {preset = "suited"} in a scene file, Material.suited(size, hit) in '
                    "Python"
                )

    def warn_of_none(self) -> None:
        """Warn of targets without any wave."""
        for name, (pixels, _, _) in self._highest.items():
            if pixels == 0:
                warn_caller(
                    f"there was no wave on {name!r}: nothing touched it. Drop or throw a body on "
                    f"it, or poke it, in a "
                    "scene file by [[drop]], [[throw]] or [[poke]]; or let a geom ripple that is "
                    "touched"
                )


def exposures_of(camera: CameraEntry) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The exposures whose mean is a frame, the same for every frame, in the order of time.

    A single one, through the middle of the lens, without shutter and aperture.

    Returns
    -------
    times : float64 [n]
        In frames after the frame's own time, when the shutter opens. The first is 0.
    offsets : float64 [n, 2]
        Point of the lens, to the right and up of its middle [m].
    """
    count = camera.exposures if camera.shutter > 0 or camera.aperture > 0 else 1
    times = camera.shutter / _FULL_TURN * np.arange(count) / count
    # the points in an order that visits all parts of the lens in any part of the time: from the
    # middle outwards, moving bodies would begin sharp and end blurred
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
    drawn = {name: drawn_heights(ripples, name, simulation.limited[name]) for name in ripples}
    shutter_times = ShutterTimes(simulation, exposures_of(simulation.scene.camera)[0])
    for number in range(frames):
        if number:
            simulation.advance_frame()
        impulses = simulation.impulses
        shown = None
        for exposure, (state, heights) in enumerate(shutter_times):
            if heights is not shown:
                data = next(states)
                shown = heights
                mujoco.mj_copyData(data, simulation.model, state)
                height_maps = {name: drawn[name](height, data) for name, height in heights.items()}
            yield Snapshot(number, exposure, data, heights, height_maps, impulses)
