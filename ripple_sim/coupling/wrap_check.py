"""A check for flexes that are pressed by more than their impulses move."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Floats

from .ids import TargetId
from .model import CoupledModel

# A flex is wrapped round something where the amounts of the forces on it are more than this many
# times their sum as vectors.
_MAX_AMOUNT_OVER_SUM = 1.1
# Steps of touch after which it is judged.
_MIN_STEPS = 50


class WrapCheck:
    """Warns of flexes that wrap round something. Called with the `Contacts` of each step by target.

    Round a ball the forces on a cloth's slopes point against one another: the amounts of the forces
    press the surface, as a string round a pole does, and the sum of the forces moves the ball.
    """

    def __init__(self, coupled: CoupledModel) -> None:
        self._names = coupled.names
        self._owners = coupled.owners
        self._flexes = {target for target, surface in coupled.soft.items() if surface.flex >= 0}
        # by target and what touches it: steps, and sums of amounts and of vector sums [N]
        self._sums: dict[tuple[TargetId, int], Floats] = {}

    def __call__(self, contacts: Mapping[TargetId, Any]) -> None:
        """Add up a step."""
        for target in contacts.keys() & self._flexes:
            others, _, forces, normals = contacts[target]
            owners = self._owners[others]
            for owner in np.unique(owners).tolist():
                mine = owners == owner
                amount = forces[mine].sum()
                together = np.linalg.norm(forces[mine] @ normals[mine])
                sums = self._sums.setdefault((target, owner), np.zeros(3))
                sums += np.array([1.0, amount, together])
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
