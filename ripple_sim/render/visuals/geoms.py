"""The geoms of a MuJoCo model other than its floor and its targets, and its sites, on the GPU.

Ambient occlusion between geoms: those near the camera's focus, approximated by capsules.

Elements of a MuJoCo model that are not drawn.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.model import find_flex_colliders
from ripple_sim.coupling.soft import first_skin, is_soft
from ripple_sim.errors import RippleWarning
from ripple_sim.render.camera import Balls, join
from ripple_sim.render.contract import MAX_OCCLUDERS, Binding
from ripple_sim.render.resources import Resources

from .instances import INSTANCE, Assets, Instances, ShapeLevels
from .shapes import NamedShape, shape_of, sizes
from .texture_mapping import mapping_of
from .visual import Visual, ball_of, geom_visual, host_of, look_of, site_visual, visible_sites

_REACH = 9.5  # in radii: what is further hides less than a hundredth of the sky


class Occluders:
    """Capsules of about each geom's size.

    Parameters
    ----------
    resources : Resources
    model : mujoco.MjModel
    geoms : int64 [k]
    """

    def __init__(self, resources: Resources, model: Any, geoms: NDArray[np.int64]) -> None:
        self._geoms = geoms
        self._centre, self._half_axis, self._radius = _capsules(model, geoms)
        self._bounds = np.linalg.norm(model.geom_aabb[geoms, 3:], axis=1)
        self._buffer = resources.buffer(reserve=32 * MAX_OCCLUDERS, dynamic=True)
        self._bound, self._bound_geoms = np.zeros((0, 2, 4)), np.zeros(0, np.int64)

    def balls(self, data: Any) -> Balls:
        """Bounding balls of the geoms."""
        return Balls(self._middles(data)[1], self._bounds)

    def bind(self, data: Any, focus: NDArray[np.float64]) -> None:
        """Bind the capsules nearest to a point [m]."""
        rotation, middle = self._middles(data)
        axis = np.einsum("gij,gj->gi", rotation, self._half_axis)
        away = np.linalg.norm(middle - focus, axis=1)
        nearest = np.argsort(away, kind="stable")
        # capsules fade out before they leave the list
        limit = away[nearest[MAX_OCCLUDERS]] if len(nearest) > MAX_OCCLUDERS else np.inf
        nearest = nearest[:MAX_OCCLUDERS]
        fade = np.clip(4 * (1 - away[nearest] / limit), 0.0, 1.0)
        packed = np.zeros((len(nearest), 2, 4), dtype=np.float32)
        packed[:, 0, :3] = (middle - axis)[nearest]
        packed[:, 1, :3] = (middle + axis)[nearest]
        packed[:, 0, 3] = self._radius[nearest] * fade
        self._buffer.write(packed.tobytes())
        self._buffer.bind_to_uniform_block(Binding.OCCLUDERS)
        self._bound, self._bound_geoms = packed.astype(np.float64), self._geoms[nearest]

    def near(self, balls: Balls, geoms: NDArray[np.int64]) -> NDArray[np.int64]:
        """Which of the bound capsules darken objects by a hundredth or more, as bits; never an object's own.

        Parameters
        ----------
        balls : Balls
            k of them, which contain the objects.
        geoms : int64 [k]
            The objects' own.
        """
        first, last, radius = self._bound[:, 0, :3], self._bound[:, 1, :3], self._bound[:, 0, 3]
        axis, to = last - first, balls.centres[:, None] - first
        along = np.einsum("ej,kej->ke", axis, to) / np.maximum(np.einsum("ej,ej->e", axis, axis), 1e-12)
        away = np.linalg.norm(to - np.clip(along, 0, 1)[..., None] * axis, axis=2) - balls.radii[:, None]
        counts = (away < _REACH * radius) & (geoms[:, None] != self._bound_geoms)
        return (counts << np.arange(len(radius))).sum(axis=1)

    def _middles(self, data: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rotation = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        return rotation, data.geom_xpos[self._geoms] + np.einsum("gij,gj->gi", rotation, self._centre)


def _capsules(model: Any, geoms: NDArray[np.int64]) -> tuple[NDArray, NDArray, NDArray]:
    """Centre, half axis and radius of a capsule of about each geom's size, in its frame."""
    centre, half_axis, radius = np.zeros((len(geoms), 3)), np.zeros((len(geoms), 3)), np.zeros(len(geoms))
    for index, geom in enumerate(geoms):
        half = np.asarray(model.geom_aabb[geom][3:], dtype=np.float64)
        centre[index] = model.geom_aabb[geom][:3]
        longest = int(np.argmax(half))
        radius[index] = np.sqrt(np.prod(np.delete(half, longest)))
        half_axis[index, longest] = max(half[longest] - radius[index], 0.0)
    return centre, half_axis, radius


_PLANE = mujoco.mjtGeom.mjGEOM_PLANE


@dataclass(frozen=True)
class TransparentVisual:
    """A visual through which the scene behind it shows."""

    visual: Visual
    number: int  # in the table of objects
    instances: Instances


class GeomVisuals:
    """All geoms of a model but the floor and the targets, and its sites, which cast shadows but occlude no sky.

    Parameters
    ----------
    assets : Assets
    geoms : iterable of int

    Attributes
    ----------
    occluders : Occluders
    transparent : list of TransparentVisual
    """

    def __init__(self, assets: Assets, geoms: Iterable[int]) -> None:
        self._assets, self._model = assets, assets.model
        self._shapes: dict[str, ShapeLevels] = {}
        self._programs: dict[tuple[int, bool], moderngl.Program] = {}
        self._depth, self._albedo, self._transmission = (
            assets.resources.program("passes/casters", MOVED=0, ALBEDO_MAP=albedo, TRANSMISSION_MAP=transmission)
            for albedo, transmission in ((0, 0), (1, 0), (0, 1))
        )
        model = assets.model
        visuals = [geom_visual(model, geom) for geom in geoms] + [site_visual(model, i) for i in visible_sites(model)]
        shaped = [(visual, shape) for visual in visuals if (shape := shape_of(model, visual)) is not None]
        solid = [visual.index for visual, _ in shaped if not visual.site and visual.kind != _PLANE]
        self.occluders = Occluders(assets.resources, model, np.array(solid, dtype=np.int64))
        groups: dict[tuple[Any, ...], tuple[NamedShape, list[tuple[Visual, int]]]] = {}
        self.transparent: list[TransparentVisual] = []
        self._hosts: dict[int, int] = {}  # geoms, by the number in the table of objects
        for visual, shape in shaped:
            mapping = mapping_of(model, visual)
            host = host_of(model, visual)
            number = assets.objects.add(look_of(model, visual), host, opacity=visual.opacity)
            self._hosts[number] = host
            if visual.opacity < 1.0:
                instances = self._instances(shape, [(visual, number)], self._transmission)
                self.transparent.append(TransparentVisual(visual, number, instances))
            else:
                key = visual.site, shape[0], mapping.kind, mapping.texture
                groups.setdefault(key, (shape, []))[1].append((visual, number))
        self._opaque = [self._instances(shape, members, self._depth) for shape, members in groups.values()]
        self._planes = [visual.index for visual, _ in shaped if not visual.site and visual.kind == _PLANE]
        self._sites = [visual for visual, _ in shaped if visual.site]

    def balls(self, data: Any) -> Balls:
        """Bounding balls of everything that may cast a shadow."""
        return join(self.occluders.balls(data), *(ball_of(self._model, data, site) for site in self._sites))

    def planes(self, data: Any) -> Balls:
        """Infinite balls at the planes."""
        return Balls(data.geom_xpos[self._planes].reshape(-1, 3), np.full(len(self._planes), np.inf))

    def update(self, data: Any, eye: NDArray[np.float64], pixels: float) -> None:
        """Take the poses from MuJoCo's data; `pixels` is the size of one metre, one metre away from the eye."""
        for instances in (*self._opaque, *(each.instances for each in self.transparent)):
            instances.update(data, eye, pixels)
            near = self.occluders.near(instances.balls, np.array([self._hosts[number] for number in instances.numbers]))
            for number, bias, bits in zip(instances.numbers, instances.shadow_biases, near, strict=True):
                self._assets.objects.set_shadow_bias(number, float(bias))
                self._assets.objects.set_occluders(number, int(bits))

    def draw(self) -> None:
        """Draw the opaque visuals into the G-buffer."""
        for instances in self._opaque:
            instances.draw()

    def draw_depth(self, view_projection: tuple[float, ...]) -> None:
        """Draw the opaque visuals' depth only, under a matrix of 16 numbers, column by column."""
        for instances in self._opaque:
            instances.draw_depth(view_projection)

    def draw_albedo(self, view_projection: tuple[float, ...]) -> None:
        """Draw the opaque geoms in their linear colours, likewise."""
        for instances in self._opaque:
            if not instances.sites:
                instances.draw_albedo(view_projection)

    def draw_transmission(self, view_projection: tuple[float, ...], light: int) -> None:
        """Draw the transparent visuals into the transmission map of a light, likewise."""
        for each in self.transparent:
            self._transmission["light"] = light
            self._transmission["transmission"] = (1.0 - each.visual.opacity,) * 3
            each.instances.draw_depth(view_projection)

    def _instances(self, shape: NamedShape, members: list[tuple[Visual, int]], depth: moderngl.Program) -> Instances:
        """Visuals of one shape and texture, each with its number in the table of objects."""
        name, make = shape
        assets = self._assets
        if name not in self._shapes:
            self._shapes[name] = ShapeLevels(assets.resources, make)
        mappings = [mapping_of(self._model, visual) for visual, _ in members]
        mapping = mappings[0]
        records = np.zeros(len(members), dtype=INSTANCE)
        for record, (visual, number), own in zip(records, members, mappings, strict=True):
            record["core_size"], record["shell_size"] = sizes(self._model, visual)
            record["color"] = [*visual.color, number]
            record["mapping"] = [*own.scale, own.stretch * own.scale[2]]
            record["tiling"] = own.tiling
        return Instances(
            assets.resources,
            self._shapes[name],
            (self._program(mapping.kind, mapping.own), depth, self._albedo),
            [visual for visual, _ in members],
            records,
            None if mapping.texture < 0 else (mapping.unit, assets.textures.get(mapping.texture)),
        )

    def _program(self, kind: int, own: bool) -> moderngl.Program:
        """Program of a kind of mapping, with the mesh's own texture coordinates or without."""
        if (kind, own) not in self._programs:
            self._programs[kind, own] = self._assets.resources.program("visuals/geom", MAPPING=kind, OWN=int(own))
        return self._programs[kind, own]


def warn_of_unsupported(model: Any, targets: Iterable[int] = ()) -> None:
    """Warn once of what will be missing from the frames; flex colliders of targets are drawn as their geoms."""
    soft = [target for target in targets if is_soft(model, target)]
    skins = sum(target >= first_skin(model) for target in soft)
    # fixed tendons tie joints together and have no path that could be drawn
    spatial = int((model.wrap_type[model.tendon_adr] != mujoco.mjtWrap.mjWRAP_JOINT).sum())
    kinds = {
        "tendons": spatial,
        "flexes": model.nflex - len(find_flex_colliders(model)) - (len(soft) - skins),
        "skins": model.nskin - skins,
    }
    missing = [f"{count} {kind}" for kind, count in kinds.items() if count]
    if missing:
        warnings.warn(
            f"the model has {' and '.join(missing)}, which are not drawn; all else is", RippleWarning, stacklevel=3
        )
