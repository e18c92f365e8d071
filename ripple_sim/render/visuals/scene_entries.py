"""Visuals of the entries of a MuJoCo scene: geoms and sites of the model, and additions to them.

An entry alone decides the type, size, pose, colour and finish of its visual, whoever wrote it. The
first entry of a geom or a site stands for the geom or site; further entries of the same id are
shown beside it, as ghosts.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import geom_id
from ripple_sim.coupling.target_mesh import height_field_triangles, mesh_arrays

from .flexes import flex_parts
from .visual import GEOM_OBJECT, SITE_OBJECT, Finish, SceneTexture, Visual, geom_visual, site_visual

_GEOM = mujoco.mjtGeom
_MESHES = (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF)
_SOFT = (_GEOM.mjGEOM_FLEX, _GEOM.mjGEOM_SKIN)
# Types of entries whose visuals do not follow the entry's pose.
_ALWAYS_NEW = (*_SOFT, _GEOM.mjGEOM_LINEBOX)
_DECOR = int(mujoco.mjtCatBit.mjCAT_DECOR)

# How far the position of an infinite plane, rounded by the scene, may be off the plane, over its
# distance from the origin.
_MAX_OFF_PLANE = 1e-5

# Difference between two boxes up to which they are equal, over their size.
_SAME_BOX = 1e-3

# Width of the edges of a box of lines, over the model's width of lines.
_BOX_LINE_WIDTH = 1.5


def content_of(entry: mujoco.MjvGeom) -> tuple[Any, ...]:
    """Everything that an entry shows, except its pose.

    A flex, a skin or a box of lines never equals another.
    """
    return (
        entry.objid,
        entry.objtype,
        entry.type,
        entry.dataid,
        entry.matid,
        entry.category,
        entry.emission,
        entry.specular,
        entry.shininess,
        entry.reflectance,
        entry.texid,
        entry.texuniform,
        entry.texrepeat.tobytes(),
        entry.rgba.tobytes(),
        entry.size.tobytes(),
        object() if entry.type in _ALWAYS_NEW else None,
    )


def identity_of(entry: mujoco.MjvGeom) -> tuple[int, int]:
    """Id and type, of `mujoco.mjtObj`, of what an entry shows."""
    return int(entry.objid), int(entry.objtype)


def is_behind(entry: mujoco.MjvGeom, eye: NDArray[np.float64]) -> bool:
    """Whether an entry is a plane that an eye [m] sees from behind."""
    return entry.type == _GEOM.mjGEOM_PLANE and bool((eye - entry.pos) @ entry.mat[:, 2] < 0.0)


def is_of_model(model: Any, entry: mujoco.MjvGeom) -> bool:
    """Whether an entry may be a geom or a site of the model."""
    count = {GEOM_OBJECT: model.ngeom, SITE_OBJECT: model.nsite}.get(int(entry.objtype), 0)
    return 0 <= entry.objid < count


def visuals_in(
    model: Any,
    scene: mujoco.MjvScene,
    entry: mujoco.MjvGeom,
    ghost: bool = False,
    reshaped: Collection[tuple[str, int]] = (),
) -> list[Visual]:
    """Visuals of an entry of a scene: one, or the edges of a box of lines, or the parts of a flex.

    A `ghost` of a geom or a site is shown beside the model's own. For `reshaped` see `own_visual`.
    """
    if not ghost and is_of_model(model, entry):
        return [own_visual(model, entry, reshaped)]
    size = np.array(entry.size, dtype=np.float64)
    asset = _asset_of(model, entry)
    visual = Visual(
        False,
        -1,
        int(entry.type),
        size,
        asset,
        group=0,
        hull=_is_hull(entry),
        identity=identity_of(entry),
        pose=(np.array(entry.pos), np.array(entry.mat)),
        half_size=size,
        box=asset_box(model, int(entry.type), asset),
        **_paint_of(entry),
    )
    if entry.type == _GEOM.mjGEOM_LINEBOX:
        return _edges_of_box(visual)
    if entry.type not in _SOFT:
        return [visual]
    in_world = replace(visual, pose=(np.zeros(3, np.float32), np.eye(3, dtype=np.float32)))
    if entry.type == _GEOM.mjGEOM_SKIN:
        return [replace(in_world, corners=_skin_corners(model, scene, int(entry.objid)))]
    visuals = []
    for part, corners in flex_parts(model, scene, entry).items():
        material = in_world.material if part == "faces" else -1
        visuals.append(replace(in_world, corners=corners, part=part, material=material))
    return visuals


def _edges_of_box(box: Visual) -> list[Visual]:
    """The twelve edges of a box, as lines."""
    position, rotation = box.pose  # type: ignore[misc]
    half = box.half_sizes
    edges = []
    for axis in range(3):
        axes = [(axis + 1) % 3, (axis + 2) % 3, axis]
        size = np.array([_BOX_LINE_WIDTH, _BOX_LINE_WIDTH, 2 * half[axis]])
        for signs in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            corner = np.zeros(3)
            corner[axes] = half[axes] * [*signs, -1]
            pose = (position + rotation @ corner).astype(np.float32), rotation[:, axes]
            edges.append(
                replace(box, kind=int(_GEOM.mjGEOM_LINE), size=size, half_size=size, pose=pose)
            )
    return edges


def own_visual(
    model: Any, entry: mujoco.MjvGeom, reshaped: Collection[tuple[str, int]] = ()
) -> Visual:
    """The geom or site of the model that an entry shows; for its pose see `ScenePoses`.

    Assets in `reshaped`, by "mesh" or "hfield" and id, have outgrown the box with which the model
    was compiled.
    """
    site = entry.objtype == SITE_OBJECT
    number = int(entry.objid)
    visual = site_visual(model, number) if site else geom_visual(model, geom_id(number))
    kind = int(entry.type)
    size = np.array(entry.size)
    asset = _asset_of(model, entry)
    half_size = None
    box = None
    # the scene's sizes are those of the model, rounded
    if kind != visual.kind or not np.array_equal(visual.half_sizes.astype(np.float32), size):
        half_size = size.astype(np.float64)
    has_outgrown = ("mesh" if kind in _MESHES else "hfield", asset) in reshaped
    if not site and ((kind, asset) != (visual.kind, visual.asset) or has_outgrown):
        box = asset_box(model, kind, asset)
    return replace(
        visual,
        kind=kind,
        asset=asset,
        hull=_is_hull(entry),
        half_size=half_size,
        box=box,
        **_paint_of(entry),
    )


def asset_box(
    model: Any, kind: int, asset: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Centre and half sizes [m] of the box about a mesh or height field, in its geom's frame.

    None without an asset.
    """
    if asset < 0:
        return None
    if kind in _MESHES:
        points = mesh_arrays(model, asset)[0]
    else:
        ground = height_field_triangles(model, asset)[0]
        foot = ground[:1] * [1, 1, 0] - [0, 0, model.hfield_size[asset, 3]]
        points = np.concatenate([ground, foot])
    low = points.min(axis=0)
    high = points.max(axis=0)
    return (low + high) / 2, (high - low) / 2


def outgrown_assets(model: Any) -> set[tuple[str, int]]:
    """Meshes and height fields whose box in the model is not their box any more.

    Each is "mesh" or "hfield", and its id.
    """
    outgrown = set()
    kinds = (*_MESHES, _GEOM.mjGEOM_HFIELD)
    for geom in np.flatnonzero(np.isin(model.geom_type, [int(kind) for kind in kinds])).tolist():
        kind = int(model.geom_type[geom])
        asset = int(model.geom_dataid[geom])
        box = asset_box(model, kind, asset)
        if box is None:
            continue
        _, half = box
        difference = np.abs(np.concatenate(box) - model.geom_aabb[geom]).max()
        if difference > _SAME_BOX * half.max():
            outgrown.add(("mesh" if kind in _MESHES else "hfield", asset))
    return outgrown


def _asset_of(model: Any, entry: mujoco.MjvGeom) -> int:
    """Id of an entry's mesh or height field, -1 without.

    In `dataid` a mesh has two numbers: one for itself, one for its hull.
    """
    data = int(entry.dataid)
    if entry.type in _MESHES and 0 <= data < 2 * model.nmesh:
        return data // 2
    if entry.type == _GEOM.mjGEOM_HFIELD and 0 <= data < model.nhfield:
        return data
    return -1


def _is_hull(entry: mujoco.MjvGeom) -> bool:
    return entry.type in _MESHES and bool(entry.dataid % 2)


def _paint_of(entry: mujoco.MjvGeom) -> dict[str, Any]:
    """Colour, material, finish and texture of an entry, as `Visual` has them."""
    texture = None
    if entry.texid >= 0:
        x, y = (float(times) for times in entry.texrepeat)
        texture = SceneTexture(int(entry.texid), (x, y), bool(entry.texuniform))
    return {
        "rgba": np.array(entry.rgba, dtype=np.float64),
        "material": int(entry.matid),
        "finish": Finish(*(float(getattr(entry, name)) for name in Finish._fields)),
        "texture": texture,
        "decor": int(entry.category) == _DECOR,
    }


def _skin_corners(model: Any, scene: mujoco.MjvScene, index: int) -> NDArray[np.float32]:
    """Corners of the triangles of a scene's skin, see `Visual`."""
    face = model.skin_faceadr[index]
    vertex = scene.skinvertadr[index]
    F = model.skin_face[face : face + model.skin_facenum[index]].ravel()
    points, normals = (
        array.reshape(-1, 3)[vertex + F] for array in (scene.skinvert, scene.skinnormal)
    )
    start = model.skin_texcoordadr[index]
    uv = model.skin_texcoord[start + F] if start >= 0 else np.zeros((len(F), 2))
    return np.concatenate([points, normals, uv], axis=1, dtype=np.float32)


class ScenePoses(NamedTuple):
    """Poses of geoms and sites in a scene, with the names of MuJoCo's data."""

    model: mujoco.MjModel
    geom_xpos: NDArray[np.float64]
    geom_xmat: NDArray[np.float64]
    site_xpos: NDArray[np.float64]
    site_xmat: NDArray[np.float64]


class EntryPoses:
    """Compares the poses of geoms and sites in a scene with the poses in MuJoCo's data.

    Parameters
    ----------
    model : mujoco.MjModel
    entries : sequence of mujoco.MjvGeom
        At most one for each geom and site.
    """

    def __init__(self, model: Any, entries: Sequence[mujoco.MjvGeom]) -> None:
        self._model = model
        self._geoms = [entry for entry in entries if entry.objtype == GEOM_OBJECT]
        self._sites = [entry for entry in entries if entry.objtype == SITE_OBJECT]
        self._geom_ids = np.array([entry.objid for entry in self._geoms], dtype=np.int64)
        self._site_ids = np.array([entry.objid for entry in self._sites], dtype=np.int64)

    def of(self, data: Any) -> Any:
        """Poses of all geoms and sites, as the scene has them.

        They are the data itself if the scene agrees with it to rounding, else `ScenePoses`.
        """
        geom = self._differing(
            self._geoms, self._geom_ids, data.geom_xpos, data.geom_xmat, planes=True
        )
        site = self._differing(self._sites, self._site_ids, data.site_xpos, data.site_xmat)
        if geom is site is None:
            return data
        geom_xpos, geom_xmat = geom or (data.geom_xpos, data.geom_xmat)
        site_xpos, site_xmat = site or (data.site_xpos, data.site_xmat)
        return ScenePoses(self._model, geom_xpos, geom_xmat, site_xpos, site_xmat)

    def _differing(
        self,
        entries: list[mujoco.MjvGeom],
        ids: NDArray[np.int64],
        positions: NDArray[np.float64],
        rotations: NDArray[np.float64],
        planes: bool = False,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Positions and rotations of all geoms or sites as the entries have them.

        None if they are equal to `positions` and `rotations`.
        """
        if not entries:
            return None
        position = np.array([entry.pos for entry in entries])
        rotation = np.array([entry.mat for entry in entries]).reshape(-1, 9)
        moved = (position != positions[ids].astype(np.float32)).any(axis=1)
        turned = (rotation != rotations[ids].astype(np.float32)).any(axis=1)
        if planes and moved.any():
            moved &= ~self._recentred(ids, position, positions[ids], rotations[ids]) | turned
        differs = moved | turned
        if not differs.any():
            return None
        positions = positions.copy()
        rotations = rotations.copy()
        positions[ids[differs]] = position[differs]
        rotations[ids[differs]] = rotation[differs]
        return positions, rotations

    def _recentred(
        self,
        ids: NDArray[np.int64],
        position: NDArray,
        own: NDArray[np.float64],
        rotation: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Which of the geoms are infinite planes that MuJoCo has moved to be below the camera.

        MuJoCo moves them within themselves.
        """
        endless = (self._model.geom_size[ids, :2] <= 0).any(axis=1)
        endless &= self._model.geom_type[ids] == _GEOM.mjGEOM_PLANE
        off = np.abs(np.einsum("ij,ij->i", position - own, rotation[:, 2::3]))
        return endless & (off <= _MAX_OFF_PLANE * (1.0 + np.abs(position).max(axis=1)))
