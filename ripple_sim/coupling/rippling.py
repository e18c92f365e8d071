"""The surfaces of targets: construction of their waves, and reconstruction after a change."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Material
from ripple_sim.solver.operator.regions import hold

from .easing import EasingLaw
from .geoms import find_target, target_name
from .ids import TargetId, is_geom
from .soft import target_pose
from .suited import suited_targets
from .target import Target
from .target_mesh import target_atlas
from .target_waves import TargetWaves, Whereabouts
from .watched import WatchedShape


@dataclasses.dataclass(frozen=True, eq=False)
class RipplingSurface:
    """The surface of a target: its waves, and what they were made from.

    Attributes
    ----------
    id : TargetId
    material : Material
    options : mapping
        Keyword arguments of `WaveSolver`.
    waves : TargetWaves
    resolution : int
        Resolution that the atlas was asked for; charts of patches have fewer texels along a side.
    held : float64 [C, n, n], optional
        Shares of the texels that are held still, 0 to 1.
    layout : str
        Layout of the atlas, as for `build_atlas`.
    shape : WatchedShape, optional
        Tells whether the surface in the model is still the atlas's.
    """

    id: TargetId
    material: Material
    options: Mapping[str, Any]
    waves: TargetWaves
    resolution: int
    held: NDArray[np.float64] | None = None
    layout: str = "auto"
    shape: WatchedShape | None = None

    def on_its_surface(self, model: mujoco.MjModel) -> RipplingSurface:
        """A copy with flat waves, on a new atlas of the surface that the model has now.

        Raises `SceneError` if something belongs to single texels of the old atlas.
        """
        name = target_name(model, self.id)
        old = self.waves
        ties = [
            ("a region of it is held still", self.held is not None),
            ("its material is given texel by texel", _is_mapped(self.material)),
            ("sensors listen to it", bool(old.listeners.all)),
        ]
        for tie, is_tied in ties:
            if is_tied:
                raise SceneError(
                    f"the surface of {name!r} was changed in the model, and {tie}, which belongs "
                    "to the old one: make new Ripples for the model as it is now"
                )
        atlas = target_atlas(model, self.id, self.resolution, self.layout)
        new = old.on(atlas, self.material, **self.options)
        new.listeners.find_points = old.listeners.find_points
        return dataclasses.replace(self, waves=new, shape=WatchedShape(model, self.id))

    def rebuilt(self, **changes: Any) -> RipplingSurface:
        """A copy with a new solver, in the state of the old one.

        `changes` are fields to change: material, options or held.
        """
        changed = dataclasses.replace(self, **changes)
        old = self.waves
        material = changed.material
        if changed.held is not None:
            material = hold(old.rest, material, changed.held)
        new = old.on(old.rest, material, **changed.options)
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


def site_on(model: mujoco.MjModel, target: TargetId, name: str) -> NDArray[np.float64]:
    """Where a site is in the frame of a target [m], [3].

    The site is on the geom's body, or on a body welded to it. The frame of a flex or a skin is the
    world; the site is then where it stands in `qpos0`. Raises `SceneError` for an unknown site, or
    one on a body that moves against the geom's.
    """
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)
    if site < 0:
        sites = (mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SITE, i) for i in range(model.nsite))
        raise SceneError(
            f"the model has no site {name!r}; its sites are "
            f"{', '.join(filter(None, sites)) or 'none'}"
        )
    data = mujoco.MjData(model)
    bodies = []
    if is_geom(target, model):
        bodies = [model.site_bodyid[site], model.geom_bodyid[target]]
    if len({int(model.body_weldid[body]) for body in bodies}) > 1:
        names = " and ".join(repr(model.body(body).name) for body in bodies)
        raise SceneError(
            f"site {name!r} and the geom it measures are on bodies {names}, which move; put it on "
            "the geom's"
        )
    mujoco.mj_kinematics(model, data)
    position, rotation = target_pose(data, target)
    return (data.site_xpos[site] - position) @ rotation


def rippling_surfaces(
    model: mujoco.MjModel,
    targets: Mapping[str, Target],
    options: Mapping[str, Any],
    whereabouts: Whereabouts,
    can_ease: bool,
) -> tuple[dict[str, RipplingSurface], dict[TargetId, EasingLaw]]:
    """The surfaces of targets, by name, and the laws by which forces on them are eased, by id.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : mapping
        By name; see `named_targets`.
    options : mapping
        Keyword arguments of `WaveSolver` that are common to all.
    whereabouts : Whereabouts
    can_ease : bool
        Whether a target whose density is chosen may take up less than all of a heavy body's forces,
        see `Easing`.
    """
    materials = {name: target.material for name, target in targets.items()}
    resolutions = {name: target.resolution for name, target in targets.items()}
    suited = suited_targets(model, materials, resolutions, can_ease=can_ease)
    surfaces = {}
    for name, target in targets.items():
        target_id = find_target(model, name)
        layout = target.layout or "auto"
        own_options = {**options, "rim": target.rim, "conserve_volume": target.conserve_volume}
        material = suited.materials[name]
        resolution = suited.resolutions[name]
        atlas = target_atlas(model, target_id, resolution, layout)
        waves = TargetWaves(whereabouts, target_id, atlas, material, **own_options)
        waves.listeners.find_points = functools.partial(site_on, model, target_id)
        shape = WatchedShape(model, target_id)
        surfaces[name] = RipplingSurface(
            target_id, material, own_options, waves, resolution, layout=layout, shape=shape
        )
    easings = {find_target(model, name): law for name, law in suited.easings.items()}
    return surfaces, easings
