"""A check for flexes that are pressed by more than their impulses move."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Floats

from .ids import TargetId
from .model import CoupledModel

# A flex wraps round something if the amounts of the forces on it are more than this many times
# their sum as vectors.
_MAX_AMOUNT_OVER_SUM = 1.1
# Number of steps of touch after which a flex is judged.
_MIN_STEPS = 50


class WrapCheck:
    """Warns of flexes that wrap round something.

    Call it with the `Contacts` of each step, by target.

    If a cloth wraps round a ball, the forces on its slopes point against one another. The amounts
    of the forces press the cloth, but only their vector sum moves the ball.
    """

    def __init__(self, coupled: CoupledModel) -> None:
        self._names = coupled.names
        self._owners = coupled.owners
        self._flexes = {target for target, surface in coupled.soft.items() if surface.flex >= 0}
        # by target and owner of the colliders that touch it: number of steps, and over these steps
        # the sums of the amounts and of the vector sums of forces [N]
        self._sums: dict[tuple[TargetId, int], Floats] = {}

    def __call__(self, contacts: Mapping[TargetId, Any]) -> None:
        """Add up a step."""
        for target in contacts.keys() & self._flexes:
            others, _, forces, normals = contacts[target]
            owners = self._owners[others]
            for owner in np.unique(owners).tolist():
                of_owner = owners == owner
                amount = forces[of_owner].sum()
                vector_sum = np.linalg.norm(forces[of_owner] @ normals[of_owner])
                sums = self._sums.setdefault((target, owner), np.zeros(3))
                sums += np.array([1.0, amount, vector_sum])
                steps, pressing, moving = sums
                if steps >= _MIN_STEPS and pressing > _MAX_AMOUNT_OVER_SUM * moving:
                    self._flexes.discard(target)
                    self._warn(target, owner, pressing / moving)
                    break

    def _warn(self, target: TargetId, owner: int, ratio: float) -> None:
        """Warn of a flex whose impulses exceed the impulse of a wrapped body by a factor."""
        flex = self._names[self._owners[target]]
        other = self._names[owner]
        warn_caller(
            f"flex {flex!r} wraps round {other!r}: its impulses are {ratio:.2f} times the impulse "
            f"that {other!r} loses, because the forces on the slopes of the flex press it, but "
            "cancel as vectors; mj_contactForce gives the vectors"
        )
