"""The waves that a scene would make without the rest filter."""

import mujoco
import numpy as np

from ripple_sim import Material, Ripples
from ripple_sim.coupling import ContactLoads, CoupledModel
from ripple_sim.solver import Load, WaveSolver


def rms(waves: WaveSolver) -> float:
    """Velocity [m/s], over the mass."""
    mass = waves.operator.mass
    return float(np.sqrt((mass * waves.velocity.astype(np.float64) ** 2).sum() / mass.sum()))


class WithAndWithout:
    """The geom "target" with the filter and without; `history` has velocities [m/s]."""

    def __init__(self, model: mujoco.MjModel, material: Material, resolution: int) -> None:
        options = {"backend": "cpu", "conserve_volume": False}
        self._model = model
        self._ripples = Ripples(model, {"target": material}, resolution=resolution, **options)
        self._ripples.allow_any_height("target")
        self.filtered = self._ripples["target"]
        self.unfiltered = WaveSolver(self.filtered.atlas, material, **options)
        self._contacts = ContactLoads(
            CoupledModel(model), {model.geom("target").id: self.unfiltered}
        )
        self.history: list[tuple[float, float]] = []

    def step(self, data: mujoco.MjData) -> None:
        """After each `mj_step`."""
        dt = self._model.opt.timestep
        self._ripples.step(data)
        self._contacts.skip()
        self._contacts.loads(data, dt)
        given = [done.on_texels for done in self._contacts.since_skip]
        self.unfiltered.step(
            dt, load=Load.together([Load(each.texels, each.forces) for each in given])
        )
        self.history.append((rms(self.filtered), rms(self.unfiltered)))
