"""The state of a simulation at moments between its physics steps, as a shutter that is open for a while sees it."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.simulation import Simulation

Heights = dict[str, NDArray[np.float32]]

_ROUNDING = 9  # decimals of a physics step: what is a whole step but for round-off is one


class Moments:
    """Moments of each frame of a simulation.

    To iterate over it is to advance the simulation through those of the present frame. Only the physics steps are made
    that would be made anyway, so that what happens does not hang on how it is filmed. A moment within a step lies on
    the way between the step's ends: bodies go along it with a steady velocity, which is how MuJoCo's Euler and implicit
    integrators move them, and heights linearly.

    Parameters
    ----------
    simulation : Simulation
    times : float64 [n]
        The moments, in frames from a frame's beginning: not falling, from 0 to 1.
    """

    def __init__(self, simulation: Simulation, times: NDArray[np.float64]) -> None:
        self._simulation = simulation
        # in physics steps
        self._places = np.round(times * simulation.steps_per_frame, _ROUNDING).tolist()
        self._start, self._between = mujoco.MjData(simulation.model), mujoco.MjData(simulation.model)

    def __iter__(self) -> Iterator[tuple[mujoco.MjData, Heights]]:
        """Advance to one moment after the other.

        Yields
        ------
        data : mujoco.MjData
            State of the bodies, until the next moment is asked for.
        heights : dict
            By the geom's name [m], float32 [6, N, N]. The same object as before where no time has passed.
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
        return {name: self._simulation.ripples[name].height for name in self._simulation.ripples}

    def _go_back(self, duration: float) -> None:
        """Set the bodies to where they were so long [s] ago, within the last step.

        After a step MuJoCo's poses are those from which it began: so are the ones here, and the way that led to them is
        that of the step before.
        """
        model, data = self._simulation.model, self._between
        mujoco.mj_copyData(data, model, self._start)
        data.time = self._simulation.data.time - duration
        mujoco.mj_integratePos(model, data.qpos, data.qvel, -duration)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)


def _blend(first: NDArray[np.float32], second: NDArray[np.float32], share: float) -> NDArray[np.float32]:
    return first + np.float32(share) * (second - first)
