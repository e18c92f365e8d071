"""A check for flexes that are pressed by more than their impulses move."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Floats

from .model import CoupledModel

# The amounts of forces on a flex over their sum as vectors, that is told of, after so many steps of
# touch.
_WRAPPED = 1.1
_TOUCHED = 50


class WrapCheck:
    """Warns of flexes that wrap round something. Called with the `Contacts` of each step by target.

    Round a ball the forces on a cloth's slopes point against one another: the surface is pressed by
    their amounts, as by a string round a pole, and the ball is moved by their sum.
    """

    def __init__(self, coupled: CoupledModel) -> None:
        self._names = coupled.names
        self._owners = coupled.owners
        self._flexes = {target for target, surface in coupled.soft.items() if surface.flex >= 0}
        # by target and what touches it: steps, amounts and sums as vectors [N]
        self._sums: dict[tuple[int, int], Floats] = {}

    def __call__(self, contacts: Mapping[int, Any]) -> None:
        """Add up a step."""
        for target in contacts.keys() & self._flexes:
            others, _, forces, normals = contacts[target]
            owners = self._owners[others]
            for owner in np.unique(owners).tolist():
                mine = owners == owner
                amount = forces[mine].sum()
                together = np.linalg.norm(forces[mine] @ normals[mine])
                found = self._sums.setdefault((target, owner), np.zeros(3))
                found += np.array([1.0, amount, together])
                steps, whole, moving = found
                if steps >= _TOUCHED and whole > _WRAPPED * moving:
                    self._flexes.discard(target)
                    flex, other = (
                        repr(self._names[each]) for each in (self._owners[target], owner)
                    )
                    warn_caller(
                        f"flex {flex} wraps round {other}: its impulses are {whole / moving:.2f} "
                        f"times what that "
                        "loses, for forces on its slopes press it, but cancel as vectors; "
                        "mj_contactForce has these"
                    )
                    break
