"""The geoms of a MuJoCo model, drawn as instances of a few shapes."""

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
from .color import linear
from .meshes import Shape

_PACKAGE = "ripple_sim.render"
_VISIBLE_GROUPS = 3
_MAX_OCCLUDERS = 16
_BEVEL = 0.06
_SHEET = 1e-3  # thickness of planes other than the floor [m]

_INSTANCE = np.dtype(
    [
        ("rotation", "f4", (3, 3)),
        ("origin", "f4", 3),
        ("core_size", "f4", 3),
        ("shell_size", "f4", 3),
        ("color", "f4", 4),
        ("material", "f4", 4),
    ]
)

_GEOM = mujoco.mjtGeom
_SHAPES: dict[int, tuple[str, Callable[[], Shape]]] = {
    _GEOM.mjGEOM_SPHERE: ("ball", lambda: meshes.ball(14)),
    _GEOM.mjGEOM_ELLIPSOID: ("ball", lambda: meshes.ball(14)),
    _GEOM.mjGEOM_CAPSULE: ("capsule", lambda: meshes.capsule(40, 9)),
    _GEOM.mjGEOM_CYLINDER: ("cylinder", lambda: meshes.cylinder(56, 3)),
    _GEOM.mjGEOM_BOX: ("box", lambda: meshes.box(3)),
    _GEOM.mjGEOM_PLANE: ("box", lambda: meshes.box(3)),
}


def visible_geoms(model: Any) -> list[int]:
    """Ids of the geoms that MuJoCo shows by default: groups 0 to 2, not fully transparent."""
    return [
        geom for geom in range(model.ngeom) if model.geom_group[geom] < _VISIBLE_GROUPS and color(model, geom)[3] > 0.0
    ]


def color(model: Any, geom: int) -> NDArray[np.float64]:
    """Linear colour and opacity of a geom: its own, or its material's where it has none of its own."""
    rgba = np.asarray(model.geom_rgba[geom], dtype=np.float64)
    material = model.geom_matid[geom]
    if material >= 0 and np.array_equal(rgba, [0.5, 0.5, 0.5, 1.0]):
        rgba = np.asarray(model.mat_rgba[material], dtype=np.float64)
    return np.append(linear(rgba[:3]), rgba[3])


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
        case _GEOM.mjGEOM_CYLINDER:
            half = np.array([size[0], size[0], size[1]])
        case _GEOM.mjGEOM_BOX:
            half = size
        case _GEOM.mjGEOM_PLANE:
            half = np.array([size[0], size[1], _SHEET])
        case _:
            return np.zeros(3), np.ones(3)
    bevel = _BEVEL * half.min()
    return half - bevel, np.full(3, bevel)


@dataclass(frozen=True)
class _Batch:
    geoms: NDArray[np.int64]
    records: NDArray
    instances: moderngl.Buffer
    solid: moderngl.VertexArray
    depth: moderngl.VertexArray


class Bodies:
    """All geoms of a model but the floor and the targets."""

    def __init__(self, gl: GLContext, model: Any, geoms: Iterable[int]) -> None:
        opaque: dict[str, list[int]] = {}
        clear: dict[str, list[int]] = {}
        shapes: dict[str, Shape] = {}
        drawn = []
        for geom in geoms:
            found = _shape_of(model, geom)
            if found is None:
                continue
            name, make = found
            if name not in shapes:
                shapes[name] = make()
            (opaque if color(model, geom)[3] >= 1.0 else clear).setdefault(name, []).append(geom)
            drawn.append(geom)
        with gl as ctx:
            programs = (
                gl.program(_PACKAGE, "body_vertex", "body_fragment"),
                gl.program(_PACKAGE, "body_depth_vertex", "depth_fragment"),
            )
            buffers = {name: _upload(ctx, shape) for name, shape in shapes.items()}
            self._opaque = [_batch(ctx, model, programs, buffers[name], ids) for name, ids in opaque.items()]
            self._clear = [_batch(ctx, model, programs, buffers[name], ids) for name, ids in clear.items()]
            self._occluders = ctx.buffer(reserve=32 * _MAX_OCCLUDERS, dynamic=True)
        self._drawn = np.array(drawn, dtype=np.int64)
        self._capsules = _capsules(model, self._drawn)
        self._radii = np.linalg.norm(model.geom_aabb[self._drawn, 3:], axis=1)

    def update(self, data: Any) -> None:
        """Take the poses from MuJoCo's data."""
        for batch in (*self._opaque, *self._clear):
            batch.records["rotation"] = data.geom_xmat[batch.geoms].reshape(-1, 3, 3).transpose(0, 2, 1)
            batch.records["origin"] = data.geom_xpos[batch.geoms]
            batch.instances.write(batch.records.tobytes())

    def balls(self, data: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bounding balls of the bodies: centres [k, 3] and radii [k], in metres."""
        rotation = data.geom_xmat[self._drawn].reshape(-1, 3, 3)
        middle = data.geom_xpos[self._drawn] + np.einsum("gij,gj->gi", rotation, self._capsules[0])
        return middle, self._radii

    def bind_occluders(self, data: Any, focus: NDArray[np.float64]) -> int:
        """Bind the bodies nearest to a point as occluding capsules; return how many there are."""
        centre, half_axis, radius = self._capsules
        rotation = data.geom_xmat[self._drawn].reshape(-1, 3, 3)
        middle = data.geom_xpos[self._drawn] + np.einsum("gij,gj->gi", rotation, centre)
        axis = np.einsum("gij,gj->gi", rotation, half_axis)
        away = np.linalg.norm(middle - focus, axis=1)
        nearest = np.argsort(away, kind="stable")
        # whichever leaves the list next has faded away before
        limit = away[nearest[_MAX_OCCLUDERS]] if len(nearest) > _MAX_OCCLUDERS else np.inf
        nearest = nearest[:_MAX_OCCLUDERS]
        fade = np.clip(4 * (1 - away[nearest] / limit), 0.0, 1.0)
        packed = np.zeros((len(nearest), 2, 4), dtype=np.float32)
        packed[:, 0, :3] = (middle - axis)[nearest]
        packed[:, 1, :3] = (middle + axis)[nearest]
        packed[:, 0, 3] = radius[nearest] * fade
        packed[:, 1, 3] = self._drawn[nearest]
        self._occluders.write(packed.tobytes())
        self._occluders.bind_to_storage_buffer(4)
        return len(nearest)

    def draw(self) -> None:
        """Draw the opaque bodies."""
        for batch in self._opaque:
            batch.solid.render(instances=len(batch.geoms))

    def draw_transparent(self) -> None:
        """Draw the others; the caller blends."""
        for batch in self._clear:
            batch.solid.render(instances=len(batch.geoms))

    def draw_depth(self, view_projection: tuple[float, ...]) -> None:
        """Draw the opaque bodies' depth alone, under a matrix of 16 numbers, column by column."""
        for batch in self._opaque:
            batch.depth.program["view_projection"] = view_projection
            batch.depth.render(instances=len(batch.geoms))


def _shape_of(model: Any, geom: int) -> tuple[str, Callable[[], Shape]] | None:
    kind = int(model.geom_type[geom])
    mesh = int(model.geom_dataid[geom])
    if kind in (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF) and mesh >= 0:
        return f"mesh {mesh}", lambda: _asset(model, mesh)
    if kind == _GEOM.mjGEOM_PLANE and model.geom_size[geom][:2].min() <= 0:
        return None
    return _SHAPES.get(kind)


def _asset(model: Any, mesh: int) -> Shape:
    """Return a mesh asset in its geom's frame, split at its creases."""
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    V = np.asarray(model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]], dtype=np.float64)
    F = np.asarray(model.mesh_face[face : face + model.mesh_facenum[mesh]], dtype=np.int64)
    corners = np.concatenate([F[:, :, None], meshes.corner_normals(V, F)], axis=2).reshape(-1, 4)
    unique, index = np.unique(corners, axis=0, return_inverse=True)
    positions = V[unique[:, 0].astype(np.int64)]
    return Shape(np.zeros_like(positions), positions, unique[:, 1:], index.reshape(-1, 3))


def _upload(ctx: moderngl.Context, shape: Shape) -> tuple[moderngl.Buffer, moderngl.Buffer]:
    vertices = np.concatenate([shape.core, shape.shell, shape.normals], axis=1)
    return ctx.buffer(vertices.astype("f4").tobytes()), ctx.buffer(shape.faces.astype("i4").tobytes())


def _batch(
    ctx: moderngl.Context,
    model: Any,
    programs: tuple[moderngl.Program, moderngl.Program],
    buffers: tuple[moderngl.Buffer, moderngl.Buffer],
    geoms: list[int],
) -> _Batch:
    records = np.zeros(len(geoms), dtype=_INSTANCE)
    for record, geom in zip(records, geoms, strict=True):
        record["core_size"], record["shell_size"] = sizes(model, geom)
        record["color"] = color(model, geom)
        record["material"] = (*_material(model, geom), geom)
    instances = ctx.buffer(reserve=records.nbytes, dynamic=True)
    vertices, indices = buffers
    names = [f"in_{name}" for name in _INSTANCE.names or ()]
    solid = ctx.vertex_array(
        programs[0],
        [(vertices, "3f 3f 3f", "in_core", "in_shell", "in_normal"), (instances, "9f 3f 3f 3f 4f 4f/i", *names)],
        indices,
    )
    depth = ctx.vertex_array(
        programs[1],
        [(vertices, "3f 3f 12x", "in_core", "in_shell"), (instances, "9f 3f 3f 3f 32x/i", *names[:4])],
        indices,
    )
    return _Batch(np.array(geoms, dtype=np.int64), records, instances, solid, depth)


def _material(model: Any, geom: int) -> tuple[float, float, float]:
    """Roughness, metallic, coat; MuJoCo's shininess stands for roughness where the material gives none."""
    material = model.geom_matid[geom]
    if material < 0:
        return 0.42, 0.0, 0.2
    roughness, metallic = float(model.mat_roughness[material]), float(model.mat_metallic[material])
    if roughness < 0:
        roughness = 0.15 + 0.55 * (1.0 - float(model.mat_shininess[material]))
    coat = 0.4 * float(model.mat_specular[material]) + float(model.mat_reflectance[material])
    return float(np.clip(roughness, 0.05, 1.0)), max(metallic, 0.0), min(coat, 1.0)


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
