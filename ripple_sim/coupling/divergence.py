"""Whether MuJoCo found its own state to be broken."""

from __future__ import annotations

import mujoco

_BROKEN = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
_NO_RESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def divergence(data: mujoco.MjData) -> str | None:
    """Name of MuJoCo's warning of a position, velocity or acceleration that is not finite or huge, else None.

    Where its automatic reset is not disabled, MuJoCo has then gone back to the initial state, and keeps the warning.
    """
    return next((warning.name for warning in _BROKEN if data.warning[warning].number), None)


def goes_on_broken(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Whether MuJoCo's automatic reset is disabled, and its state is broken since the last one."""
    return bool(model.opt.disableflags & _NO_RESET) and divergence(data) is not None


def divergence_warning(model: mujoco.MjModel, data: mujoco.MjData) -> str | None:
    """What to warn of where the simulation has diverged, else None."""
    broken = divergence(data)
    if broken is None:
        return None
    then = (
        "its automatic reset is disabled, and the ripples stay flat until you reset it"
        if model.opt.disableflags & _NO_RESET
        else "MuJoCo reset it to its initial state, and the ripples with it"
    )
    advice = "use a shorter time step in the MJCF's <option>, or softer contacts"
    return f"the simulation diverged ({broken}): {then}; {advice}"
