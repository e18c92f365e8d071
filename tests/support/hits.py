"""Bodies that hit targets while the waves run."""

from __future__ import annotations

import mujoco
import numpy as np

from ripple_sim import Impulse, Material, Ripples, Target


class Run:
    """A model in motion, the waves of its targets, and the impulses of every step, `hits`.

    The model may be a specification, the material its density [kg/m^2] alone; `contacts` are those
    of all targets, the options those of `Ripples`.
    """

    def __init__(
        self,
        model,
        *targets: str,
        density: float = 50.0,
        material: Material | None = None,
        contacts=None,
        **options,
    ):
        self.model = model.compile() if isinstance(model, mujoco.MjSpec) else model
        self.data = mujoco.MjData(self.model)
        options = {"resolution": 12, "backend": "cpu", "conserve_volume": False, **options}
        target = Target(material or Material(density=density), contacts=contacts)
        self.ripples = Ripples(self.model, dict.fromkeys(targets, target), **options)
        self.hits: list[list[Impulse]] = []

    def step(self) -> list[Impulse]:
        """Take a step; its impulses."""
        mujoco.mj_step(self.model, self.data)
        self.ripples.step(self.data)
        self.hits.append(self.ripples.last_impulses)
        return self.hits[-1]

    def until(self, time: float) -> Run:
        """Take steps up to a time [s]."""
        while self.data.time < time - 1e-9:
            self.step()
        return self

    def given(self, target: str | None = None) -> float:
        """Sum of the impulses, of one target if it is named [N s]."""
        return sum(hit.impulse for hits in self.hits for hit in hits if target in (None, hit.geom))

    @property
    def pairs(self) -> set[tuple[str, str]]:
        """Names of the geoms that met: the target's, and the other one's."""
        return {(hit.geom, hit.other) for hits in self.hits for hit in hits}


def contact_forces(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Forces [N] and torques [N m] of contacts in their frames, [k, 6]; normal force first."""
    wrenches = np.zeros((data.ncon, 6))
    for i, wrench in enumerate(wrenches):
        mujoco.mj_contactForce(model, data, i, wrench)
    return wrenches
