"""How strongly contacts pull: sticky geoms, and MuJoCo's adhesion actuators, such as suckers."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

# Contacts that pull though they do not push: all right, or within the gap.
_FORCE, _GAP = 0, 1


class Adhesion:
    """Forces with which contacts pull at their geoms.

    MuJoCo's constraint solver holds geoms apart against the pull, so that its forces contain it: what a target receives
    is their difference. An adhesion actuator shares its force among all contacts of its body, and also those within the
    gap.

    Parameters
    ----------
    model : mujoco.MjModel
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        # bodies and places among the forces of the actuators that pull
        pulling = np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_BODY)
        self._actuators = list(
            zip(model.actuator_trnid[pulling, 0].tolist(), model.actuator_outadr[pulling].tolist(), strict=True)
        )

    def __call__(self, data: mujoco.MjData) -> NDArray[np.float64] | None:
        """Pull of every contact [N], [ncon]; None where nothing in the model pulls."""
        if not (self._model.flg_adhesion or self._actuators):
            return None
        contacts = data.contact
        pulls = contacts.adhesion.copy()
        if self._actuators:
            bodies = np.where(contacts.geom >= 0, self._model.geom_bodyid[contacts.geom], -1)
            bodies[(bodies < 0).any(axis=1) | ~np.isin(contacts.exclude, (_FORCE, _GAP))] = -1
            for body, force in self._actuators:
                on_body = (bodies == body).any(axis=1)
                pulls[on_body] += data.actuator_force[force] / max(on_body.sum(), 1)
        return pulls
