"""From the contacts of a physics step to loads on the texels of all targets."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Load, WaveSolver

from .at_rest import at_rest
from .contact_reader import ContactReader
from .contact_record import ContactRecord, Impulse, Touch
from .load import TargetLoad
from .model import CoupledModel
from .pose import Pose
from .sleeping_contacts import SleepingContacts
from .soft_ids import target_pose


class ContactLoads:
    """The loads of all contacts, target by target and step by step.

    Parameters
    ----------
    coupled : CoupledModel
    waves : mapping
        Geom id of every target to its waves. Looked at again by `waves_changed` and `clear`.
    """

    def __init__(self, coupled: CoupledModel, waves: Mapping[int, WaveSolver]) -> None:
        self._coupled, self._waves = coupled, waves
        self._contacts = ContactReader(coupled, {geom: each.atlas for geom, each in waves.items()})
        self.clear()

    def clear(self) -> None:
        """Forget all contacts."""
        self._sleeping, self._begins = SleepingContacts(self._coupled), True
        self._targets = {
            geom: TargetLoad(waves, self._coupled.footprint_radii, self._convex(geom))
            for geom, waves in self._waves.items()
        }
        self.skip()

    def skip(self) -> None:
        """Forget the latest steps: nothing was given since."""
        self._records: list[ContactRecord] = []
        self._touching: list[ContactRecord] = []
        self._impulses: list[Impulse] | None = None

    def waves_changed(self, geom: int) -> None:
        """Go on with the new waves of a target."""
        self._targets[geom].set_waves(self._waves[geom])

    def loads(self, data: mujoco.MjData, elapsed: float) -> dict[int, Load]:
        """Load on each target over a time [s], from the contact forces that MuJoCo held over its latest time step.

        Bodies that sleep press as before.
        """
        loads = {}
        self._impulses, self._touching = None, []
        self._timestep = self._coupled.model.opt.timestep
        if self._begins:
            # bodies that sleep already never touched before our eyes
            self._begins, resting = False, at_rest(self._coupled.model, data)
            if resting is not None:
                self._sleeping.add(data, self._contacts.read(resting))
        contacts = self._sleeping.add(data, self._contacts.read(data))
        for geom, target in self._targets.items():
            if geom in contacts:
                target.follow(self._waves[geom].atlas)
                pose = Pose(*target_pose(data, geom))
                loads[geom], record = target.touched(contacts[geom], pose, self._timestep, elapsed)
                self._records.append(record)
                self._touching.append(record)
            else:
                loads[geom] = target.untouched(elapsed)
        return loads

    def _convex(self, target: int) -> NDArray[np.bool_]:
        """Colliders that touch between the points where they touch: a flex has a contact at each of its vertices."""
        convex = self._coupled.convex
        return np.zeros_like(convex) if target in self._coupled.soft else convex

    @property
    def impulses(self) -> list[Impulse]:
        """The impulses given since `skip`, one record for each pair and step."""
        if self._impulses is None:
            self._impulses = [
                impulse
                for record in self._records
                for impulse in record.impulses(
                    self._coupled.names,
                    self._coupled.owners,
                    self._waves[record.contacts.target].atlas,
                    self._timestep,
                )
            ]
        return self._impulses

    @property
    def touches(self) -> list[Touch]:
        """The pairs that touched in the latest step."""
        return [touch for record in self._touching for touch in record.touches()]
