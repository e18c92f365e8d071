"""`Targets`: the rippling geoms of a model, and what may be changed on them while their waves run."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Material, SolverError, WaveSolver
from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.operator.assembly import hold
from ripple_sim.solver.operator.plate_rim import Rim
from ripple_sim.solver.texels.atlas import check_points
from ripple_sim.solver.waves.footprint import Footprint, footprint

from .geoms import ByGeom, GeomKey, by_name, find_any, find_target, for_each, rotation_in_body, target_name
from .soft import is_soft, target_pose
from .suited import suited_targets
from .target_mesh import target_atlas
from .watched import WatchedShape

# How far off the surface a poke may be without a word, over the object's size.
_FAR = 0.1


@dataclasses.dataclass(frozen=True, eq=False)
class Target:
    """A geom that ripples: its waves, and what they are made of.

    Attributes
    ----------
    geom : int
        Geom id.
    material : Material
    options : mapping
        Keyword arguments of `WaveSolver`.
    waves : WaveSolver
    held : float64 [C, n, n], optional
        Shares of the texels that are held still.
    layout : str
        Of its atlas, as for `build_atlas`.
    shape : WatchedShape, optional
        Its surface in the model, as the atlas has it.
    """

    geom: int
    material: Material
    options: Mapping[str, Any]
    waves: WaveSolver
    held: NDArray[np.float64] | None = None
    layout: str = "auto"
    shape: WatchedShape | None = None

    def on_its_surface(self, model: mujoco.MjModel) -> Target:
        """The same, flat, on a new atlas of the surface that the model has now.

        Raises `SceneError` if something belongs to single texels of the old atlas.
        """
        name, old = target_name(model, self.geom), self.waves
        bound = [
            ("a region of it is held still", self.held is not None),
            ("its material is given texel by texel", _is_mapped(self.material)),
            ("sensors listen to it", bool(old.listeners.all)),
        ]
        for what, so in bound:
            if so:
                raise SceneError(
                    f"the surface of {name!r} was changed in the model, and {what}, which belongs to the old one: make "
                    "new Ripples for the model as it is now"
                )
        atlas = target_atlas(model, self.geom, old.rest.resolution, self.layout)
        new = WaveSolver(atlas, self.material, **self.options)
        new.listeners.find_points = old.listeners.find_points
        return dataclasses.replace(self, waves=new, shape=WatchedShape(model, self.geom))

    def rebuilt(self, **changes: Any) -> Target:
        """The same with a new solver in the state of the old one, after a change of its material, options or `held`."""
        changed = dataclasses.replace(self, **changes)
        old, material = self.waves, changed.material
        if changed.held is not None:
            material = hold(old.rest, material, changed.held)
        new = WaveSolver(old.rest, material, **changed.options)
        if old.vertices is not None:
            new.move(old.vertices)
        new.state = old.state
        new.listeners.use(old.listeners.all)
        new.listeners.find_points = old.listeners.find_points
        return dataclasses.replace(changed, waves=new)


def _is_mapped(material: Material) -> bool:
    """Whether a coefficient has a number for each texel."""
    values = [getattr(material, field.name) for field in dataclasses.fields(material)]
    return any(isinstance(value, np.ndarray) and value.ndim for value in values)


def site_on(model: mujoco.MjModel, geom: int, name: str) -> NDArray[np.float64]:
    """Where a site is in the frame of a target [m], [3]: of a geom on the same body, or welded to it.

    In that of a flex or a skin, the world, it is where it stands in `qpos0`. Raises `SceneError` for an unknown site,
    or one on a body that moves against the geom's.
    """
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)
    if site < 0:
        sites = (mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SITE, i) for i in range(model.nsite))
        raise SceneError(f"the model has no site {name!r}; its sites are {', '.join(filter(None, sites)) or 'none'}")
    data = mujoco.MjData(model)
    bodies = [] if is_soft(model, geom) else [model.site_bodyid[site], model.geom_bodyid[geom]]
    if len({int(model.body_weldid[body]) for body in bodies}) > 1:
        names = " and ".join(repr(model.body(body).name) for body in bodies)
        raise SceneError(
            f"site {name!r} and the geom it measures are on bodies {names}, which move; put it on the geom's"
        )
    mujoco.mj_kinematics(model, data)
    position, rotation = target_pose(data, geom)
    return (data.site_xpos[site] - position) @ rotation


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
    conserve_volume : bool, None or mapping
        Of the waves, likewise.
    options : mapping
        Further keyword arguments of `WaveSolver`.
    can_ease : bool
        Whether a target whose density is chosen may take up less than all of a heavy body's forces, see `Easing`.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        materials: ByGeom[Material],
        resolution: int | ByGeom[int | None] | None,
        layout: str | ByGeom[str],
        rim: Rim | ByGeom[Rim],
        conserve_volume: bool | ByGeom[bool | None] | None,
        options: Mapping[str, Any],
        can_ease: bool = False,
    ) -> None:
        if not isinstance(materials, Mapping):
            raise SceneError(f"materials is {type(materials).__name__}; valid is a mapping of geom names to Material")
        for key, material in materials.items():
            find_target(model, key)
            if not isinstance(material, Material):
                raise SceneError(f"material of geom {key!r} is {material!r}; valid is a Material")
        named = by_name(model, materials, "materials")
        given = for_each(model, named, "resolution", resolution)
        layouts, rims = for_each(model, named, "layout", layout), for_each(model, named, "rim", rim)
        conserves = for_each(model, named, "conserve_volume", conserve_volume)
        suited = suited_targets(model, named, given, can_ease=can_ease)
        named, texels = suited.materials, suited.resolutions
        self.model = model
        self._targets = {}
        for name, material in named.items():
            geom, own = find_target(model, name), {**options, "rim": rims[name], "conserve_volume": conserves[name]}
            atlas = target_atlas(model, geom, texels[name], layouts[name])
            waves, shape = WaveSolver(atlas, material, **own), WatchedShape(model, geom)
            self._targets[name] = Target(geom, material, own, waves, layout=layouts[name], shape=shape)
            self[name].listeners.find_points = functools.partial(site_on, model, geom)
        self._easings = {find_target(model, name): law for name, law in suited.easings.items()}
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
        names = [field.name for field in dataclasses.fields(Material)]
        for given in coefficients:
            if given not in names:
                raise SolverError(f"a material has no coefficient {given!r}; valid are {', '.join(names)}")
        self._change(name, material=dataclasses.replace(self._target(name).material, **coefficients))
        if "density" in coefficients:
            self._take_up_all(self._target(name).geom)

    def poke(self, name: GeomKey, point: ArrayLike, impulse: float, radius: float = 0.0) -> Footprint:
        """Give a geom's surface an impulse at once, as `[[poke]]` in a scene file does.

        Parameters
        ----------
        name : str or int
            Geom.
        point : [3]
            In the frame of the geom's body, as places in an MJCF are [m]; the nearest surface point is taken, with a
            warning where that is far.
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
        waves, place = self._target(name).waves, self.to_geom(name, point)
        where = waves.add_impulse(place, impulse, radius)
        off, size = float(np.linalg.norm(place - where.point)), float(np.ptp(waves.atlas.mesh.V, axis=0).max())
        if off > _FAR * size:
            warn_caller(
                f"a poke of {name!r} is {off:.3g} m off its surface ({off / size:.0%} of its size); the nearest point "
                f"is poked. Points are in the frame of the geom's body [m]"
            )
        return where

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
        atlas = self._target(name).waves.atlas
        disc = np.zeros(atlas.areas.shape)
        disc.reshape(-1)[footprint(atlas, self.to_geom(name, point), radius).texels] = 1.0
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
        before = self._target(name).held
        try:
            held = np.asarray(region, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise SolverError(f"region is {region!r}; valid are numbers from 0 to 1, one for each texel") from error
        if before is not None and held.shape == before.shape:
            held = np.maximum(held, before)
        self._change(name, held=held)

    def change_operator(self, operator: str) -> None:
        """Change the wave operator on all surfaces, by its name in `WaveSolver`; height and velocity stay.

        Raises `SolverError` for an unknown operator.
        """
        for name, target in list(self._targets.items()):
            self._change(name, options={**target.options, "operator": operator})

    def to_geom(self, name: GeomKey, point: ArrayLike) -> NDArray[np.float64]:
        """Carry a point [m] from the frame of a geom's body to that of the geom, which MuJoCo chooses for meshes.

        The points of `poke` and `make_rigid` are in the body's frame; those of an atlas, and of the waves of one geom,
        `ripples[name]`, in the geom's.
        """
        geom = self._target(name).geom
        if is_soft(self.model, geom):  # it is in the world
            return np.array(point, dtype=np.float64)
        places = check_points(point) - self.model.geom_pos[geom]
        return (places @ rotation_in_body(self.model, geom)).reshape(np.shape(point))

    def _take_up_all(self, geom: int) -> None:
        """Ease no forces on a target any more: the user gives its density."""
        self._easings.pop(geom, None)

    def _target(self, name: GeomKey) -> Target:
        target = self._targets.get(name) if isinstance(name, str) else None
        if target is None:
            target = self._targets.get(target_name(self.model, find_any(self.model, name)))
        if target is None:
            raise SceneError(
                f"geom {name!r} does not ripple; the rippling geoms are {', '.join(map(repr, self._targets))}"
            )
        return target

    def _follow_shapes(self) -> list[str]:
        """Lay new atlases on the targets whose surfaces were changed in the model; return the names of these."""
        changed = [
            name
            for name, target in self._targets.items()
            if target.shape is not None and target.shape.changed(self.model)
        ]
        for name in changed:
            target = self._targets[name].on_its_surface(self.model)
            self._targets[name], self._waves[target.geom] = target, target.waves
        return changed

    def _change(self, name: GeomKey, **changes: Any) -> None:
        """Change a target's material, options or what is held, see `Target`; if that fails, nothing has changed."""
        target = self._target(name).rebuilt(**changes)
        self._targets[target_name(self.model, target.geom)] = target
        self._waves[target.geom] = target.waves
