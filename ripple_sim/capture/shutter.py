"""A simulation's state at times between its physics steps, while the shutter is open."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.simulation import Simulation
from ripple_sim.solver.backends.gl_fields import DeviceField

Field: TypeAlias = NDArray[np.float32] | DeviceField
Heights = dict[str, Field]

_ROUNDING = 9  # decimals of a physics step: what is a whole step but for round-off is one


class ShutterTimes:
    """States of a simulation at given times of each frame.

    Iterating over it advances the simulation through the times of the present frame. It takes the same physics steps
    as without a shutter, so motion blur does not change the motion. Within a step, states are interpolated between its
    ends: bodies move at constant velocity, as in MuJoCo's Euler and implicit integrators, and heights linearly.

    Parameters
    ----------
    simulation : Simulation
    times : float64 [n]
        In frames from a frame's beginning, ascending, from 0 to 1.
    """

    def __init__(self, simulation: Simulation, times: NDArray[np.float64]) -> None:
        self._simulation = simulation
        # in physics steps
        self._places = np.round(times * simulation.steps_per_frame, _ROUNDING).tolist()
        self._start, self._between = mujoco.MjData(simulation.model), mujoco.MjData(simulation.model)

    def __iter__(self) -> Iterator[tuple[mujoco.MjData, Heights]]:
        """Advance to one time after the other.

        Yields
        ------
        data : mujoco.MjData
            State of the bodies, until the next iteration.
        heights : dict
            By the geom's name [m], float32 [C, n, n], or on the GPU, see `WaveSolver.snapshot`. The same object as
            before where no time has passed.
        """
        simulation = self._simulation
        done = 0
        before = now = self._heights()
        for place in self._places:
            while done < place:
                mujoco.mj_copyData(self._start, simulation.model, simulation.data)
                simulation.step()
                before, now = now, self._heights()
                done += 1
            rest = done - place
            if rest == 0:
                yield simulation.data, now
            else:
                self._go_back(rest * simulation.model.opt.timestep)
                yield self._between, {name: _blend(now[name], before[name], rest) for name in now}

    def _heights(self) -> Heights:
        return {name: self._simulation.ripples[name].snapshot() for name in self._simulation.ripples}

    def _go_back(self, duration: float) -> None:
        """Set the bodies to where they were a duration [s] ago, within the last step.

        After `mj_step` MuJoCo's poses are those at the step's beginning. So are these, and the motion that led to them
        is the one of the step before.
        """
        model, data = self._simulation.model, self._between
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
