"""One target: the waves on a geom's surface, and the material that may change while they run."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver import Atlas, Material, SolverError, WaveSolver
from ripple_sim.solver.operator.regions import hold
from ripple_sim.solver.texels.atlas import check_points
from ripple_sim.solver.waves.footprint import footprint

from .soft_ids import is_soft


class Target:
    """A geom that ripples.

    Parameters
    ----------
    model : mujoco.MjModel
    geom : int
        Geom id.
    atlas : Atlas
        Of its surface, in the frame of the geom.
    material : Material
    options : mapping
        Keyword arguments of `WaveSolver`.

    Attributes
    ----------
    geom : int
    waves : WaveSolver
        A new one after each change, in the state of the old one.
    """

    def __init__(
        self, model: mujoco.MjModel, geom: int, atlas: Atlas, material: Material, options: Mapping[str, Any]
    ) -> None:
        self.geom = geom
        self._model, self._material, self._options = model, material, dict(options)
        self._held: NDArray[np.float64] | None = None
        self.waves = WaveSolver(atlas, material, **options)

    def change_material(self, **coefficients: Any) -> None:
        """Change coefficients of the material, by their names in `Material`.

        Raises
        ------
        SolverError
            For an unknown or invalid coefficient; the old ones stay.
        """
        names = [field.name for field in dataclasses.fields(Material)]
        for name in coefficients:
            if name not in names:
                raise SolverError(f"a material has no coefficient {name!r}; valid are {', '.join(names)}")
        self._rebuild(dataclasses.replace(self._material, **coefficients), self._held, self._options)

    def change_operator(self, operator: str) -> None:
        """Change the wave operator, by its name in `WaveSolver`."""
        self._rebuild(self._material, self._held, {**self._options, "operator": operator})

    def make_rigid(self, point: ArrayLike, radius: float) -> None:
        """Hold a disc still, of a radius [m] round a point [m] in the body's frame; waves bounce off its rim."""
        disc = np.zeros(self.waves.atlas.areas.shape)
        disc.reshape(-1)[footprint(self.waves.atlas, self.to_geom(point), radius).texels] = 1.0
        self.hold(disc)

    def hold(self, region: ArrayLike) -> None:
        """Hold a region still, bool or shares from 0 to 1, [C, n, n], beside those held already; see `hold`."""
        try:
            held = np.asarray(region, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise SolverError(f"region is {region!r}; valid are numbers from 0 to 1, one for each texel") from error
        if self._held is not None and held.shape == self._held.shape:
            held = np.maximum(held, self._held)
        self._rebuild(self._material, held, self._options)

    def to_geom(self, point: ArrayLike) -> NDArray[np.float64]:
        """Carry a point [m] from the frame of the geom's body to that of the geom; what is soft is in the world."""
        if is_soft(self._model, self.geom):
            return np.array(point, dtype=np.float64)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, self._model.geom_quat[self.geom])
        places = check_points(point) - self._model.geom_pos[self.geom]
        return (places @ rotation.reshape(3, 3)).reshape(np.shape(point))

    def _rebuild(self, material: Material, held: NDArray[np.float64] | None, options: dict[str, Any]) -> None:
        """Make a new solver in the old one's state; if that fails, nothing has changed."""
        old, held_material = self.waves, material
        if held is not None:
            held_material = hold(old.rest, material, held)
        new = WaveSolver(old.rest, held_material, **options)
        if old.vertices is not None:
            new.move(old.vertices)
        new.state = old.state
        self.waves, self._material, self._held, self._options = new, material, held, options
