"""`Targets`: the rippling geoms of a model, and what may be changed on them while their waves run."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Atlas, Material, SolverError, WaveSolver
from ripple_sim.solver.operator.assembly import hold
from ripple_sim.solver.texels.atlas import check_points
from ripple_sim.solver.waves.footprint import Footprint, footprint

from .geoms import ByGeom, GeomKey, checked_materials, find_any, find_target, for_each, target_name
from .soft import is_soft
from .suited import suited_targets
from .target_mesh import target_atlas


class Target:
    """A geom that ripples: its waves, and what they are made of.

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
    held : float64 [C, n, n] or None
        Shares of the texels that are held still.
    waves : WaveSolver
        A new one after each change, in the state of the old one.
    """

    def __init__(
        self, model: mujoco.MjModel, geom: int, atlas: Atlas, material: Material, options: Mapping[str, Any]
    ) -> None:
        self.geom, self.material = geom, material
        self._model, self._options = model, dict(options)
        self.held: NDArray[np.float64] | None = None
        self.waves = WaveSolver(atlas, material, **options)

    def to_geom(self, point: ArrayLike) -> NDArray[np.float64]:
        """Carry a point [m] from the frame of the geom's body to that of the geom; what is soft is in the world."""
        if is_soft(self._model, self.geom):
            return np.array(point, dtype=np.float64)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, self._model.geom_quat[self.geom])
        places = check_points(point) - self._model.geom_pos[self.geom]
        return (places @ rotation.reshape(3, 3)).reshape(np.shape(point))

    def rebuild(self, material: Material, held: NDArray[np.float64] | None, **options: Any) -> None:
        """Make a new solver in the old one's state; if that fails, nothing has changed."""
        old, options = self.waves, {**self._options, **options}
        new = WaveSolver(old.rest, material if held is None else hold(old.rest, material, held), **options)
        if old.vertices is not None:
            new.move(old.vertices)
        new.state = old.state
        self.waves, self.material, self.held, self._options = new, material, held, options


class Targets:
    """The rippling geoms of a model.

    Parameters
    ----------
    model : mujoco.MjModel
    materials : mapping
        Geom to its `Material`; what that leaves unset is chosen by the model, see `suited_material`.
    resolution : int, None or mapping
        Of the atlases, for all targets or by geom. None: chosen by the model, see `suited_resolution`.
    layout, rim : str or mapping
        Of the atlases and their waves, likewise.
    options : mapping
        Further keyword arguments of `WaveSolver`.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        materials: ByGeom[Material],
        resolution: int | ByGeom[int | None] | None,
        layout: str | ByGeom[str],
        rim: str | ByGeom[str],
        options: Mapping[str, Any],
    ) -> None:
        named = checked_materials(model, materials)
        given = for_each(model, named, "resolution", resolution)
        layouts, rims = for_each(model, named, "layout", layout), for_each(model, named, "rim", rim)
        named, texels = suited_targets(model, named, given)
        self.model = model
        self._targets = {
            name: Target(
                model,
                (geom := find_target(model, name)),
                target_atlas(model, geom, texels[name], layouts[name]),
                material,
                {**options, "rim": rims[name]},
            )
            for name, material in named.items()
        }
        # by geom id; shared with all who load or read the waves, and see new ones as soon as they are in here
        self._waves = {target.geom: target.waves for target in self._targets.values()}

    def __getitem__(self, name: GeomKey) -> WaveSolver:
        """Waves of a geom, by name or id."""
        return self._target(name).waves

    def __iter__(self) -> Iterator[str]:
        return iter(self._targets)

    def __len__(self) -> int:
        return len(self._targets)

    @property
    def geom_ids(self) -> dict[str, int]:
        """Geom id of every target, by name; a flex or a skin has one after all geoms."""
        return {name: target.geom for name, target in self._targets.items()}

    def change_material(self, name: GeomKey, **coefficients: Any) -> None:
        """Change coefficients of a geom's material, by their names in `Material`; height and velocity stay.

        Raises
        ------
        SceneError
            For an unknown geom.
        SolverError
            For an unknown or invalid coefficient.
        """
        target = self._target(name)
        names = [field.name for field in dataclasses.fields(Material)]
        for each in coefficients:
            if each not in names:
                raise SolverError(f"a material has no coefficient {each!r}; valid are {', '.join(names)}")
        target.rebuild(dataclasses.replace(target.material, **coefficients), target.held)
        self._waves_changed(name)

    def poke(self, name: GeomKey, point: ArrayLike, impulse: float, radius: float = 0.0) -> Footprint:
        """Give a geom's surface an impulse at once, as `[[poke]]` in a scene file does.

        Parameters
        ----------
        name : str or int
            Geom.
        point : [3]
            In the frame of the geom's body, as places in an MJCF are [m]; the nearest surface point is taken.
        impulse : float
            [N s]; positive presses inwards.
        radius : float
            Of the footprint, along the surface [m]; at least two texels are used.

        Returns
        -------
        Footprint
            The texels that were hit.

        Raises
        ------
        SceneError
            For an unknown geom.
        SolverError
            If the impulse, the point or the radius is not finite, or the radius negative.
        """
        target = self._target(name)
        return target.waves.add_impulse(target.to_geom(point), impulse, radius)

    def make_rigid(self, name: GeomKey, point: ArrayLike, radius: float) -> None:
        """Hold a disc of a geom's surface still: waves go round it, and contacts there move nothing.

        Parameters
        ----------
        name : str or int
            Geom.
        point : [3]
            In the frame of the geom's body [m]; the nearest surface point is taken.
        radius : float
            Along the surface [m].
        """
        target = self._target(name)
        disc = np.zeros(target.waves.atlas.areas.shape)
        disc.reshape(-1)[footprint(target.waves.atlas, target.to_geom(point), radius).texels] = 1.0
        self.hold(name, disc)

    def hold(self, name: GeomKey, region: ArrayLike) -> None:
        """Hold a region of a geom's surface still, as `make_rigid` does with a disc.

        Parameters
        ----------
        name : str or int
            Geom.
        region : bool or float [C, n, n]
            The texels to hold; from 0 to 1 for a share of a texel.

        Raises
        ------
        SolverError
            If the region has another shape, or numbers that are not from 0 to 1.
        """
        target = self._target(name)
        try:
            held = np.asarray(region, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise SolverError(f"region is {region!r}; valid are numbers from 0 to 1, one for each texel") from error
        if target.held is not None and held.shape == target.held.shape:
            held = np.maximum(held, target.held)
        target.rebuild(target.material, held)
        self._waves_changed(name)

    def change_operator(self, operator: str) -> None:
        """Change the wave operator on all surfaces, by its name in `WaveSolver`; height and velocity stay.

        Raises
        ------
        SolverError
            For an unknown operator.
        """
        for name, target in self._targets.items():
            target.rebuild(target.material, target.held, operator=operator)
            self._waves_changed(name)

    def to_geom(self, name: GeomKey, point: ArrayLike) -> NDArray[np.float64]:
        """Carry a point [m] from the frame of a geom's body to that of the geom, which MuJoCo chooses for meshes.

        The points of `poke` and `make_rigid` are in the body's frame; those of an atlas, and of the waves of one geom,
        `ripples[name]`, in the geom's.
        """
        return self._target(name).to_geom(point)

    def _target(self, name: GeomKey) -> Target:
        target = self._targets.get(name) if isinstance(name, str) else None
        if target is None:
            target = self._targets.get(target_name(self.model, find_any(self.model, name)))
        if target is None:
            raise SceneError(
                f"geom {name!r} does not ripple; the rippling geoms are {', '.join(map(repr, self._targets))}"
            )
        return target

    def _waves_changed(self, name: GeomKey) -> None:
        """Hand a target's new waves to everybody."""
        self._waves[self._target(name).geom] = self[name]
