"""Which geoms and flexes MuJoCo lets touch each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray


class ContactMasks:
    """The contact masks of a model's geoms, and its predefined pairs.

    Parameters
    ----------
    model : mujoco.MjModel
    flex_colliders : mapping
        Geom id to the id of its flex collider, whose masks are the geom's.
    convex_colliders : mapping
        Geom id to the ids of its convex colliders, whose masks are the geom's alone.

    Attributes
    ----------
    contype, conaffinity : int32 [ngeom]
        Of what collides: the geom, its flex, or its convex colliders.
    collides : bool [ngeom]
        Whether anything at all may touch a geom.
    """

    def __init__(
        self, model: mujoco.MjModel, flex_colliders: Mapping[int, int], convex_colliders: Mapping[int, Sequence[int]]
    ) -> None:
        self._model = model
        self.contype, self.conaffinity = model.geom_contype.copy(), model.geom_conaffinity.copy()
        for geom, flex in flex_colliders.items():
            self.contype[geom], self.conaffinity[geom] = model.flex_contype[flex], model.flex_conaffinity[flex]
        for geom, parts in convex_colliders.items():
            self.contype[geom], self.conaffinity[geom] = model.geom_contype[parts[0]], model.geom_conaffinity[parts[0]]
            self.contype[parts] = self.conaffinity[parts] = 0
        self._soft = np.setdiff1d(np.arange(model.nflex), list(flex_colliders.values()))
        paired = np.isin(np.arange(model.ngeom), [model.pair_geom1, model.pair_geom2])
        self.collides = (self.contype | self.conaffinity).astype(np.bool_) | paired

    def match(self, geoms: Sequence[int]) -> NDArray[np.bool_]:
        """Geoms, [ngeom], that MuJoCo collides with one of these by their masks, or as a pair."""
        found, pairs = np.zeros(self._model.ngeom, dtype=np.bool_), (self._model.pair_geom1, self._model.pair_geom2)
        for geom in geoms:
            found |= (self.contype[geom] & self.conaffinity | self.contype & self.conaffinity[geom]) != 0
            for one, two in (pairs, pairs[::-1]):
                found[two[one == geom]] = True
        return found

    def apart(self, geom: int) -> NDArray[np.bool_]:
        """Geoms, [ngeom], on bodies not welded to that of this one."""
        weld = self._model.body_weldid[self._model.geom_bodyid]
        return np.asarray(weld != weld[geom])

    def out_of_touch(self, geom: int, colliders: Sequence[int]) -> bool:
        """Whether there are geoms or flexes that collide, but none that meets those that collide for this geom."""
        meets = (self.match(colliders) & self.apart(geom)).any() or len(self.soft_flexes(colliders))
        return not meets and bool(len(self._soft) or (self.collides & self.apart(geom)).any())

    def soft_flexes(self, geoms: Sequence[int]) -> NDArray[np.int64]:
        """Flexes other than flex colliders that MuJoCo collides with one of these geoms."""
        model, soft, of = self._model, self._soft, list(geoms)
        types, affinities = model.flex_contype[soft, None], model.flex_conaffinity[soft, None]
        return soft[((self.contype[of] & affinities | types & self.conaffinity[of]) != 0).any(axis=1)]
