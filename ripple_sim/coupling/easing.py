"""Easing: the surface of a material that the model chose bears what is far heavier than what it is to show.

A robot's torso can be hit by a ball and bear the whole robot, whose impulses differ by a factor of
a thousand. Waves are proportional to impulses, so that no density shows the one and bears the
other. Where the user gives no density, the model chooses one that shows the lightest body, and
`Easing` limits the forces of the others.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Floats, Ints
from ripple_sim.solver.operator.suited_law import depth_under
from ripple_sim.solver.texels.thickness import half_thickness

from .model import CoupledModel

# Where less than this share of a force is taken up, it is told.
_TOLD = 0.25


class EasingLaw(NamedTuple):
    """How much of a force a surface takes up.

    Attributes
    ----------
    most : float
        Force up to which the surface takes up what it is given, smoothed over time [N].
    rate : float
        Of the smoothing, an exponential one; that of the surface's own swing [1/s].
    thickness : float
        Half the target's thickness where this holds [m]; where it is thinner the most is less by as
        much.
    """

    most: float
    rate: float
    thickness: float

    @classmethod
    def of(
        cls,
        share: float,
        thickness: float,
        *,
        radius: float,
        density: float,
        speed: float,
        stiffness: float,
    ) -> EasingLaw:
        """The law by which a surface is dented by a share of half its thickness at most, by a hit or a weight at rest.

        A hit J that is short beside the surface's swing of rate w counts as a force J w. Arguments
        are as for `density_under`.
        """
        unit = depth_under(1.0, radius=radius, density=density, speed=speed, stiffness=stiffness)
        return cls(share * thickness / unit, math.sqrt(stiffness), thickness)


class Easing:
    """Which share of each body's force a target takes up, step by step.

    Each body's smoothed force stays below the law's most: all of a light hit is taken up, and of a
    harder one as much as of one that just reaches the most.

    Parameters
    ----------
    law : EasingLaw
    bodies : int64 [c]
        What counts as one body: an id for each collider.
    atlas : Atlas
        Of the target.

    Attributes
    ----------
    least_share : float
        The least share so far.
    """

    def __init__(self, law: EasingLaw, bodies: NDArray[np.int64], atlas: Atlas) -> None:
        self._law = law
        self._atlas = atlas
        self._bodies = bodies
        self._smoothed = np.zeros(int(bodies.max(initial=0)) + 1)
        self.least_share = 1.0

    @functools.cached_property
    def _thinness(self) -> Floats:
        """Thickness of the target at each texel over that of the law, at most 1."""
        return np.minimum(half_thickness(self._atlas).reshape(-1) / self._law.thickness, 1.0)

    def shares(self, colliders: Ints, texels: Ints, forces: Floats, elapsed: float) -> Floats:
        """Share that is taken up of each collider's force [N] near a texel, which is held over a time [s]."""
        bodies = self._bodies[colliders]
        total = np.bincount(bodies, np.abs(forces), len(self._smoothed))
        fading = math.exp(-self._law.rate * elapsed)
        remaining = self._smoothed * fading
        added = total * (1 - fading)
        thinnest = np.ones_like(total)
        np.minimum.at(thinnest, bodies, self._thinness[texels])
        room = np.maximum(self._law.most * thinnest - remaining, 0.0)
        share = np.divide(room, added, out=np.ones_like(added), where=added > room)
        self._smoothed = remaining + share * added
        self.least_share = min(self.least_share, float(share[bodies].min(initial=1.0)))
        return share[bodies]

    def pause(self, elapsed: float) -> None:
        """Go on by a time [s] in which nothing touches."""
        self._smoothed *= math.exp(-self._law.rate * elapsed)

    def clear(self) -> None:
        """Forget all forces."""
        self._smoothed[:] = 0.0


def bodies_of(coupled: CoupledModel) -> NDArray[np.int64]:
    """What counts as one body to `Easing`: the root of each collider's tree, and one for all flexes."""
    model = coupled.model
    bodies = np.full(len(coupled.owners), model.nbody, dtype=np.int64)
    rigid = coupled.owners < model.ngeom
    bodies[rigid] = model.body_rootid[model.geom_bodyid[coupled.owners[rigid]]]
    return bodies


def easing_warning(name: str, easing: Easing) -> str | None:
    """What to warn of where forces are eased, else None."""
    if easing.least_share >= _TOLD:
        return None
    return (
        f"geom {name!r} shows hits of the lightest body that can touch it, and takes up "
        f"{easing.least_share:.2g} of "
        "the force of a heavier one, which would dent it too deep (`last_impulses` has all of it). "
        "For waves in "
        "proportion to every impulse, give the material a density"
    )
