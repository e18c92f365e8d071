"""The geoms of a MuJoCo model other than its floor and its targets."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.gl import GLContext

from . import meshes
from .instances import INSTANCE, Instances, ShapeLevels
from .materials import Mapping, Textures, color, look_of, mapping_of
from .meshes import Shape
from .objects import ObjectTable
from .occluders import Occluders
from .owned import OwnedObjects

_PACKAGE = "ripple_sim.render"
_VISIBLE_GROUPS = 3
_BEVEL = 0.06
_ENDLESS = 100.0  # half size of planes without an end, in extents of the model

_GEOM = mujoco.mjtGeom
# name, and how the shape is made with a number of segments to a right angle
_SHAPES: dict[int, tuple[str, Callable[[int], Shape]]] = {
    _GEOM.mjGEOM_SPHERE: ("ball", meshes.ball),
    _GEOM.mjGEOM_ELLIPSOID: ("ball", meshes.ball),
    _GEOM.mjGEOM_CAPSULE: ("capsule", lambda n: meshes.capsule(4 * n, n)),
    _GEOM.mjGEOM_CYLINDER: ("cylinder", lambda n: meshes.cylinder(4 * n, 3)),
    _GEOM.mjGEOM_BOX: ("box", lambda n: meshes.box(min(n // 3, 3))),
    _GEOM.mjGEOM_PLANE: ("sheet", lambda n: meshes.sheet()),
}


def visible_geoms(model: Any) -> list[int]:
    """Ids of the geoms that MuJoCo shows by default: groups 0 to 2, not fully transparent."""
    return [
        geom for geom in range(model.ngeom) if model.geom_group[geom] < _VISIBLE_GROUPS and color(model, geom)[3] > 0.0
    ]


def sizes(model: Any, geom: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Core and shell size of a geom [m], shape [3] each (see meshes.py)."""
    size = np.asarray(model.geom_size[geom], dtype=np.float64)
    match model.geom_type[geom]:
        case _GEOM.mjGEOM_SPHERE:
            return np.zeros(3), np.full(3, size[0])
        case _GEOM.mjGEOM_ELLIPSOID:
            return np.zeros(3), size
        case _GEOM.mjGEOM_CAPSULE:
            return np.array([0.0, 0.0, size[1]]), np.full(3, size[0])
        case _GEOM.mjGEOM_PLANE:
            half = np.where(size > 0, size, _ENDLESS * model.stat.extent)
            return np.array([half[0], half[1], 0.0]), np.full(3, 1e-9)
        case _GEOM.mjGEOM_CYLINDER:
            half = np.array([size[0], size[0], size[1]])
        case _GEOM.mjGEOM_BOX:
            half = size
        case _:
            return np.zeros(3), np.ones(3)
    bevel = _BEVEL * half.min()
    return half - bevel, np.full(3, bevel)


@dataclass(frozen=True)
class ClearBody:
    """A body that the scene behind it shows through."""

    geom: int
    number: int  # in the table of objects
    instances: Instances


class Bodies:
    """All geoms of a model but the floor and the targets."""

    def __init__(
        self, gl: GLContext, ctx: OwnedObjects, model: Any, geoms: Iterable[int], textures: Textures, table: ObjectTable
    ) -> None:
        self._gl, self._ctx, self._model, self._textures = gl, ctx, model, textures
        self._shapes: dict[str, ShapeLevels] = {}
        self._programs: dict[int, moderngl.Program] = {}
        self._depth = ctx.own(gl.program(_PACKAGE, "body_depth_vertex", "depth_fragment"))
        drawn: list[int] = []
        groups: dict[tuple[str, int, int], list[tuple[int, int]]] = {}
        shapes: dict[str, tuple[str, Callable[[int], Shape]]] = {}
        self.clear: list[ClearBody] = []
        for geom in geoms:
            found = shape_of(model, geom)
            if found is None:
                continue
            mapping, opacity = mapping_of(model, geom), float(color(model, geom)[3])
            number = table.add(look_of(model, geom), geom, opacity=opacity)
            drawn.append(geom)
            shapes[found[0]] = found
            if opacity < 1.0:
                self.clear.append(ClearBody(geom, number, self._instances(found, mapping, [(geom, number)])))
            else:
                groups.setdefault((found[0], mapping.kind, mapping.texture), []).append((geom, number))
        self._opaque = [
            self._instances(shapes[name], mapping_of(model, members[0][0]), members)
            for (name, _, _), members in groups.items()
        ]
        solid = [geom for geom in drawn if model.geom_type[geom] != _GEOM.mjGEOM_PLANE]
        self.occluders = Occluders(ctx, model, np.array(solid, dtype=np.int64))

    def update(self, data: Any, eye: NDArray[np.float64], pixels: float) -> None:
        """Take the poses from MuJoCo's data; `pixels` is the size of one metre, one metre away from the eye."""
        for instances in (*self._opaque, *(body.instances for body in self.clear)):
            instances.update(data, eye, pixels)

    def draw(self) -> None:
        """Draw the opaque bodies into the geometry pass."""
        for instances in self._opaque:
            instances.draw()

    def draw_depth(self, view_projection: tuple[float, ...]) -> None:
        """Draw the opaque bodies' depth alone, under a matrix of 16 numbers, column by column."""
        for instances in self._opaque:
            instances.draw_depth(view_projection)

    def _instances(
        self, shape: tuple[str, Callable[[int], Shape]], mapping: Mapping, members: list[tuple[int, int]]
    ) -> Instances:
        name, make = shape
        if name not in self._shapes:
            self._shapes[name] = ShapeLevels(self._ctx, make)
        if mapping.kind not in self._programs:
            self._programs[mapping.kind] = self._ctx.own(
                self._gl.program(_PACKAGE, "body_geometry_vertex", "body_geometry_fragment", MAPPING=mapping.kind)
            )
        records = np.zeros(len(members), dtype=INSTANCE)
        for record, (geom, number) in zip(records, members, strict=True):
            own = mapping_of(self._model, geom)
            record["core_size"], record["shell_size"] = sizes(self._model, geom)
            record["color"] = [*color(self._model, geom)[:3], number]
            record["mapping"] = [*own.scale, own.own]
        return Instances(
            self._ctx,
            self._shapes[name],
            (self._programs[mapping.kind], self._depth),
            [geom for geom, _ in members],
            records,
            mapping,
            None if mapping.texture < 0 else self._textures.get(mapping.texture),
        )


def shape_of(model: Any, geom: int) -> tuple[str, Callable[[int], Shape]] | None:
    """Name of a geom's shape, and what makes it with a number of segments to a right angle; None for other types."""
    kind, asset = int(model.geom_type[geom]), int(model.geom_dataid[geom])
    if kind in (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF) and asset >= 0:
        return f"mesh {asset}", lambda _: meshes.mesh_asset(model, asset)
    if kind == _GEOM.mjGEOM_HFIELD and asset >= 0:
        return f"hfield {asset}", lambda _: meshes.height_field(model, asset)
    return _SHAPES.get(kind)
