"""MuJoCo's flags that random models switch on and off.

The flags that leave nothing to see when they are off, such as `contact` and `gravity`, are left
out.
"""

import mujoco

_ALL_VERSIONS = (
    "equality",
    "frictionloss",
    "limit",
    "damper",
    "spring",
    "clampctrl",
    "warmstart",
    "filterparent",
    "actuation",
    "refsafe",
    "sensor",
    "midphase",
    "eulerdamp",
    "autoreset",
    "nativeccd",
    "island",
    "multiccd",
    "override",
    "energy",
    "fwdinv",
    "invdiscrete",
    "sleep",
    "diagexact",
)


def _is_known(flag: str) -> bool:
    """Whether the installed MuJoCo has a flag."""
    enables = hasattr(mujoco.mjtEnableBit, f"mjENBL_{flag.upper()}")
    disables = hasattr(mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}")
    return enables or disables


# Flags of the installed MuJoCo. Random draws follow this order: another order makes other models.
FLAGS = [flag for flag in _ALL_VERSIONS if _is_known(flag)]
