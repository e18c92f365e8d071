"""The geoms of a MuJoCo model other than its floor and its targets, and its sites."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.object_table import ObjectTable
from ripple_sim.render.gpu.resources import OwnedObjects
from ripple_sim.solver.gl import GLContext

from . import primitives as meshes
from .instances import INSTANCE, Instances, ShapeLevels
from .materials import Textures, look_of
from .occluders import Occluders
from .primitives import Shape
from .texture_mapping import mapping_of
from .visual import Piece, ball_of, geom_piece, host_of, site_piece, visible_sites

_PACKAGE = "ripple_sim.render"
_BEVEL = 0.06
_ENDLESS = 100.0  # half size of planes without an end, in extents of the model

_GEOM = mujoco.mjtGeom
# name, and how the shape is made with a number of segments to a right angle
_Shape = tuple[str, Callable[[int], Shape]]
_SHAPES: dict[int, _Shape] = {
    _GEOM.mjGEOM_SPHERE: ("ball", meshes.ball),
    _GEOM.mjGEOM_ELLIPSOID: ("ball", meshes.ball),
    _GEOM.mjGEOM_CAPSULE: ("capsule", lambda n: meshes.capsule(4 * n, n)),
    _GEOM.mjGEOM_CYLINDER: ("cylinder", lambda n: meshes.cylinder(4 * n, 3)),
    _GEOM.mjGEOM_BOX: ("box", lambda n: meshes.box(min(n // 3, 3))),
    _GEOM.mjGEOM_PLANE: ("sheet", lambda n: meshes.sheet()),
}


def sizes(model: Any, piece: Piece) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Core and shell size of a piece [m], shape [3] each (see meshes.py)."""
    half = piece.half_sizes
    match piece.kind:
        case _GEOM.mjGEOM_SPHERE | _GEOM.mjGEOM_ELLIPSOID:
            return np.zeros(3), half
        case _GEOM.mjGEOM_CAPSULE:
            return np.array([0.0, 0.0, half[2]]), np.full(3, half[0])
        case _GEOM.mjGEOM_PLANE:
            half = np.where(half > 0, half, _ENDLESS * model.stat.extent)
            return np.array([half[0], half[1], 0.0]), np.full(3, 1e-9)
        case _GEOM.mjGEOM_CYLINDER | _GEOM.mjGEOM_BOX:
            bevel = _BEVEL * half.min()
            return half - bevel, np.full(3, bevel)
        case _:
            return np.zeros(3), np.ones(3)


@dataclass(frozen=True)
class ClearBody:
    """A body that the scene behind it shows through."""

    piece: Piece
    number: int  # in the table of objects
    instances: Instances


class Bodies:
    """All geoms of a model but the floor and the targets, and its sites, which throw shadows but hide no sky.

    Parameters
    ----------
    gl : GLContext
    ctx : OwnedObjects
    model : mujoco.MjModel
    geoms : iterable of int
    textures : Textures
    table : ObjectTable
        Takes a row for each.
    """

    def __init__(
        self, gl: GLContext, ctx: OwnedObjects, model: Any, geoms: Iterable[int], textures: Textures, table: ObjectTable
    ) -> None:
        self._gl, self._ctx, self._model, self._textures, self._table = gl, ctx, model, textures, table
        self._shapes: dict[str, ShapeLevels] = {}
        self._programs: dict[tuple[int, bool], moderngl.Program] = {}
        self._depth = ctx.own(gl.program(_PACKAGE, "visuals/geom_depth_vertex", "glsl/depth_fragment"))
        pieces = [geom_piece(model, geom) for geom in geoms] + [site_piece(model, i) for i in visible_sites(model)]
        shaped = [(piece, shape) for piece in pieces if (shape := shape_of(model, piece)) is not None]
        solid = [piece.index for piece, _ in shaped if not piece.site and piece.kind != _GEOM.mjGEOM_PLANE]
        self.occluders = Occluders(ctx, model, np.array(solid, dtype=np.int64))
        groups: dict[tuple[Any, ...], tuple[_Shape, list[tuple[Piece, int]]]] = {}
        self.clear: list[ClearBody] = []
        for piece, shape in shaped:
            mapping = mapping_of(model, piece)
            number = table.add(look_of(model, piece), host_of(model, piece), opacity=piece.opacity)
            if piece.opacity < 1.0:
                self.clear.append(ClearBody(piece, number, self._instances(shape, [(piece, number)])))
            else:
                key = piece.site, shape[0], mapping.kind, mapping.texture
                groups.setdefault(key, (shape, []))[1].append((piece, number))
        self._opaque = [self._instances(shape, members) for shape, members in groups.values()]
        self._planes = [piece.index for piece, _ in shaped if not piece.site and piece.kind == _GEOM.mjGEOM_PLANE]
        self._sites = [piece for piece, _ in shaped if piece.site and piece.opacity == 1.0]

    def balls(self, data: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bounding balls of all that may throw a shadow: centres [k, 3] and radii [k], in metres."""
        centres, radii = self.occluders.balls(data)
        if self._sites:
            balls = [ball_of(self._model, data, site) for site in self._sites]
            centres = np.concatenate([centres, [ball[0] for ball in balls]])
            radii = np.concatenate([radii, [ball[1] for ball in balls]])
        return centres, radii

    def planes(self, data: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions [k, 3] of the planes, which no ball bounds, and as many infinite radii."""
        return data.geom_xpos[self._planes].reshape(-1, 3), np.full(len(self._planes), np.inf)

    def update(self, data: Any, eye: NDArray[np.float64], pixels: float) -> None:
        """Take the poses from MuJoCo's data; `pixels` is the size of one metre, one metre away from the eye."""
        for instances in (*self._opaque, *(body.instances for body in self.clear)):
            instances.update(data, eye, pixels)
            for number, lift in zip(instances.numbers, instances.lifts, strict=True):
                self._table.set_lift(number, float(lift))

    def draw(self) -> None:
        """Draw the opaque bodies into the geometry pass."""
        for instances in self._opaque:
            instances.draw()

    def draw_depth(self, view_projection: tuple[float, ...], *, sites: bool) -> None:
        """Draw the opaque bodies' depth alone, under a matrix of 16 numbers, column by column; sites on request."""
        for instances in self._opaque:
            if sites or not instances.sites:
                instances.draw_depth(view_projection)

    def _instances(self, shape: _Shape, members: list[tuple[Piece, int]]) -> Instances:
        """Pieces of one shape under one texture, each with its number in the table of objects."""
        name, make = shape
        if name not in self._shapes:
            self._shapes[name] = ShapeLevels(self._ctx, make)
        mappings = [mapping_of(self._model, piece) for piece, _ in members]
        mapping = mappings[0]
        variant = mapping.kind, mapping.own
        if variant not in self._programs:
            options = {"MAPPING": mapping.kind, "OWN": int(mapping.own)}
            self._programs[variant] = self._ctx.own(
                self._gl.program(_PACKAGE, "visuals/geom_vertex", "visuals/geom_fragment", **options)
            )
        records = np.zeros(len(members), dtype=INSTANCE)
        for record, (piece, number), own in zip(records, members, mappings, strict=True):
            record["core_size"], record["shell_size"] = sizes(self._model, piece)
            record["color"] = [*piece.color, number]
            record["mapping"] = [*own.scale, own.stretch * own.scale[2]]
            record["tiling"] = own.tiling
        return Instances(
            self._ctx,
            self._shapes[name],
            (self._programs[variant], self._depth),
            [piece for piece, _ in members],
            records,
            mapping,
            None if mapping.texture < 0 else self._textures.get(mapping.texture),
        )


def shape_of(model: Any, piece: Piece) -> _Shape | None:
    """Name of a piece's shape, and what makes it with a number of segments to a right angle; None for other types."""
    kind, asset = piece.kind, piece.asset
    if kind in (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF) and asset >= 0:
        return f"mesh {asset}", lambda _: meshes.mesh_asset(model, asset)
    if kind == _GEOM.mjGEOM_HFIELD and asset >= 0:
        return f"hfield {asset}", lambda _: meshes.height_field(model, asset)
    return _SHAPES.get(kind)
