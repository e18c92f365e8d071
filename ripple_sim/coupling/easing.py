"""Easing: a surface on which the lightest body makes visible waves bears far heavier bodies.

A robot's torso is hit by a ball, and bears the whole robot: their impulses differ by a factor of a
thousand. Waves are proportional to impulses, so that no density shows the ball and bears the robot.
Where the user gives no density, the model chooses one that shows the lightest body, and
`Easing` limits the forces of the heavier bodies.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Floats, Ints
from ripple_sim.solver.operator.suited_law import depth_under
from ripple_sim.solver.texels.thickness import half_thickness

from .model import CoupledModel

# A warning is given where less than this share of a force is taken up.
_WARNED_SHARE = 0.25


class EasingLaw(NamedTuple):
    """How much of a force a surface takes up.

    Attributes
    ----------
    most : float
        Greatest force that the surface takes up, smoothed over time [N].
    rate : float
        Rate of the exponential smoothing, which is that of the surface's own swing [1/s].
    thickness : float
        Half the target's thickness for which `most` holds [m]; where the target is thinner, the
        greatest force is smaller in proportion.
    reach : float
        Length over which a dent fades [m]; the thinnest place within it counts.
    """

    most: float
    rate: float
    thickness: float
    reach: float = 0.0

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
        """The law that limits dents to a share of half the surface's thickness.

        An impulse J that is short beside the surface's swing of rate w counts as a force J w. The
        arguments are as for `density_under`.
        """
        depth_per_force = depth_under(  # [m/N]
            1.0, radius=radius, density=density, speed=speed, stiffness=stiffness
        )
        rate = math.sqrt(stiffness)
        return cls(
            most=share * thickness / depth_per_force,
            rate=rate,
            thickness=thickness,
            reach=speed / rate,
        )


class Easing:
    """Which share of each body's force a target takes up, step by step.

    Each body's smoothed force stays below the law's `most`: all of a light hit is taken up, and of
    a harder hit as much as of a hit that just reaches `most`.

    Parameters
    ----------
    law : EasingLaw
    bodies : int64 [c]
        For each collider the id of its body, see `bodies_of`.
    atlas : Atlas
        Of the target.

    Attributes
    ----------
    least_share : float
        The least share so far.
    """

    def __init__(self, law: EasingLaw, bodies: NDArray[np.int64], atlas: Atlas) -> None:
        self.least_share = 1.0
        self._law = law
        self._bodies = bodies
        self._atlas = atlas
        # by texel, see `_thinness_at`
        self._thinness: dict[int, float] = {}
        # smoothed force of each body [N]
        self._smoothed = np.zeros(int(bodies.max(initial=0)) + 1)

    @functools.cached_property
    def _half_thickness(self) -> Floats:
        """Half the target's thickness at each texel [m]."""
        return half_thickness(self._atlas).reshape(-1)

    @functools.cached_property
    def _texel_tree(self) -> KDTree:
        """Search tree of the texels' positions."""
        return KDTree(self._atlas.positions.reshape(-1, 3))

    def _thinness_at(self, texels: Ints) -> Floats:
        """Least thickness within a dent's reach of each texel over that of the law, at most 1."""
        for texel in texels.tolist():
            if texel not in self._thinness:
                position = self._texel_tree.data[texel]
                texels_in_reach = self._texel_tree.query_ball_point(position, self._law.reach)
                thinnest = float(self._half_thickness[texels_in_reach].min())
                self._thinness[texel] = min(thinnest / self._law.thickness, 1.0)
        return np.array([self._thinness[texel] for texel in texels.tolist()])

    def shares(self, colliders: Ints, texels: Ints, forces: Floats, elapsed: float) -> Floats:
        """Share of each collider's force that the surface takes up, [k].

        Parameters
        ----------
        colliders : int64 [k]
            Ids of the colliders that touch.
        texels : int64 [k]
            Flat indices of texels near the contacts.
        forces : float64 [k]
            [N].
        elapsed : float
            How long the forces are held [s].
        """
        bodies = self._bodies[colliders]
        # by body [N]
        body_forces = np.bincount(bodies, np.abs(forces), len(self._smoothed))
        fading = math.exp(-self._law.rate * elapsed)
        remaining = self._smoothed * fading
        added = body_forces * (1 - fading)
        thinness = np.ones_like(body_forces)
        np.minimum.at(thinness, bodies, self._thinness_at(texels))
        # how much of `added` is taken up
        room = np.maximum(self._law.most * thinness - remaining, 0.0)
        share = np.divide(room, added, out=np.ones_like(added), where=added > room)
        self._smoothed = remaining + share * added
        self.least_share = min(self.least_share, float(share[bodies].min(initial=1.0)))
        return share[bodies]

    def pause(self, elapsed: float) -> None:
        """Advance by a time [s] without contact."""
        self._smoothed *= math.exp(-self._law.rate * elapsed)

    def clear(self) -> None:
        """Forget all forces."""
        self._smoothed[:] = 0.0


def bodies_of(coupled: CoupledModel) -> NDArray[np.int64]:
    """Body of each collider for `Easing`: the root of the collider's tree; one for all flexes."""
    model = coupled.model
    bodies = np.full(len(coupled.owners), model.nbody, dtype=np.int64)
    rigid = coupled.owners < model.ngeom
    bodies[rigid] = model.body_rootid[model.geom_bodyid[coupled.owners[rigid]]]
    return bodies


def easing_warning(name: str, easing: Easing) -> str | None:
    """The warning about a target whose forces are eased; None if they are taken up nearly whole."""
    if easing.least_share >= _WARNED_SHARE:
        return None
    return (
        f"geom {name!r} shows hits of the lightest body that can touch it, and takes up "
        f"{easing.least_share:.2g} of the force of a heavier one, which would dent it too deep "
        "(`last_impulses` has all of it). For waves in proportion to every impulse, give the "
        "material a density"
    )
