"""Contact forces are read only where MuJoCo has solved for them."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

# The order of a loop's calls shows in almost every step with contacts. The first ones are checked, then one in so many.
_FIRST, _EVERY = 20, 20

UNSOLVED_WARNING = (
    "`Ripples.step` was called between `mj_step1` and `mj_step2`, before MuJoCo had solved for the contact forces: "
    "they are solved for with the controls as they are, and may differ from those of the coming `mj_step2`; call "
    "`step` between `mj_step2` and `mj_step1`, or take steps within `with ripples.following(data):`"
)


class SolvedForces:
    """Finds data whose contact forces belong to its contacts.

    After `mj_step`, or `mj_step1` and `mj_step2`, `data.contact` and `data.efc_force` are those of the latest step. But
    a loop that ends with `mj_step1` has found the contacts of the next step already, and the forces beside them mean
    nothing until `mj_step2`. Then the generalised force of the latest solution, `data.qfrc_constraint`, is not the one
    that these forces have on the present Jacobian J: J^T f.

    Parameters
    ----------
    model : mujoco.MjModel
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._force = np.zeros(model.nv)
        self._steps = 0
        self._completed: mujoco.MjData | None = None

    def of(self, data: mujoco.MjData) -> tuple[mujoco.MjData, bool]:
        """Data with solved forces, and whether they had to be solved for here.

        That is `data` itself, or a copy of it, completed as `mj_step2` will do with the controls as they are. Once it
        had to be the copy it always is: forces of the step before may happen to fit, and would be counted twice.
        Forces that are solved already come out the same.
        """
        if not data.nefc:
            return data, False
        self._steps += 1
        if self._completed is None:
            if (self._steps > _FIRST and self._steps % _EVERY) or self._solved(data):
                return data, False
            self._completed = copy.copy(data)
        model = self._model
        mujoco.mj_copyData(self._completed, model, data)
        mujoco.mj_fwdActuation(model, self._completed)
        mujoco.mj_fwdAcceleration(model, self._completed)
        mujoco.mj_fwdConstraint(model, self._completed)
        return self._completed, True

    def _solved(self, data: mujoco.MjData) -> bool:
        mujoco.mj_mulJacTVec(self._model, data, self._force, data.efc_force)
        expected = data.qfrc_constraint
        # the sums may be made in another order
        return float(np.abs(self._force - expected).max()) <= 1e-9 * (1.0 + float(np.abs(expected).max()))
