"""A mark in MuJoCo's data that every reset wipes out.

Time alone does not tell: a reset after one step, and one more step, and it is the same time again; or steps that nobody
saw after a reset bring the time to where it was, or beyond; or a keyframe sets it to any value.
"""

from __future__ import annotations

import random

import mujoco

_FWDINV = int(mujoco.mjtEnableBit.mjENBL_FWDINV)
# nothing that is computed depends on the marks, so they may differ from run to run
_random = random.SystemRandom()


class ResetMark:
    """Sees whether `data` was reset since it last looked.

    The mark is a negative number in `data.solver_fwdinv[0]`: a step leaves it alone, `copy` keeps it, and
    `mj_resetData`, a keyframe and the automatic reset of a simulation that diverges all wipe it out. MuJoCo's own
    values there are not negative, and written only where the flag `fwdinv` is enabled: then no mark is made, and only
    a time that goes back tells.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Accept whatever mark comes next."""
        self._mark: float | None = None

    def __getstate__(self) -> dict[str, object]:
        # MuJoCo's data loses the mark when it is pickled; that is no reset
        return {"_mark": None}

    def stands(self, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
        """Whether the mark is still there. Makes one where there is none, and takes over one that others made."""
        if model.opt.enableflags & _FWDINV:
            return True
        found = float(data.solver_fwdinv[0])
        if not found < 0:
            found = -1.0 - _random.random()
            data.solver_fwdinv[0] = found
        stands = self._mark is None or found == self._mark
        self._mark = found
        return stands
