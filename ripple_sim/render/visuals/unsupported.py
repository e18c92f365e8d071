"""Elements of a MuJoCo model that are not drawn."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import Any

import mujoco

from ripple_sim.coupling.flex_colliders import find_flex_colliders
from ripple_sim.coupling.soft_ids import first_skin, is_soft
from ripple_sim.errors import RippleWarning


def warn_of_unsupported(model: Any, targets: Iterable[int] = ()) -> None:
    """Warn once of what will be missing from the frames; flex colliders of targets are drawn as their geoms."""
    soft = [target for target in targets if is_soft(model, target)]
    skins = sum(target >= first_skin(model) for target in soft)
    # fixed tendons tie joints together and have no path that could be drawn
    spatial = int((model.wrap_type[model.tendon_adr] != mujoco.mjtWrap.mjWRAP_JOINT).sum())
    kinds = {
        "tendons": spatial,
        "flexes": model.nflex - len(find_flex_colliders(model)) - (len(soft) - skins),
        "skins": model.nskin - skins,
    }
    missing = [f"{count} {kind}" for kind, count in kinds.items() if count]
    if missing:
        warnings.warn(
            f"the model has {' and '.join(missing)}, which are not drawn; all else is", RippleWarning, stacklevel=3
        )
