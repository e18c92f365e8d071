"""The bodies of a model as meshes: everything that the renderer draws beside the targets."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.geoms import geom_name
from ripple_sim.coupling.ids import TargetId, geom_id
from ripple_sim.render.contract import MappingKind
from ripple_sim.render.surfaces.surface import painted
from ripple_sim.render.tone_mapping import srgb_to_linear
from ripple_sim.render.visuals.corners import normalized
from ripple_sim.render.visuals.geoms import visuals_of
from ripple_sim.render.visuals.shapes import Shape, sizes
from ripple_sim.render.visuals.texture_mapping import (
    TextureMapping,
    glow_texture,
    mapping_of,
)
from ripple_sim.render.visuals.visual import (
    Look,
    Visual,
    look_of,
    target_visual,
    texture_has_opacity,
    texture_pixels,
    texture_pixels_with_opacity,
    visible_geoms,
)

from .moving_mesh import MovingMesh
from .source import Source


class Solid(NamedTuple):
    """A geom or site as a mesh in its own frame.

    Attributes
    ----------
    finish : Finish
    name : str
    body : int
    position, quaternion : float64 [3], [4]
        In its body's frame [m], w first.
    points, normals : float64 [n, 3]
    F : int64 [m, 3]
    uv : float64 [m, 3, 2], optional
        Places of the corners in its flat texture, v from the image's lower edge; images repeat.
    """

    finish: Finish
    name: str
    body: int
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    F: NDArray[np.int64]
    uv: NDArray[np.float64] | None


class Finish(NamedTuple):
    """How a surface looks.

    Attributes
    ----------
    look : Look
    color : float64 [3]
        Linear.
    opacity : float
    texture : int
        Id of its flat texture, -1 without.
    glow : int
        Id of the flat texture of what it emits, -1 without.
    """

    look: Look
    color: NDArray[np.float64]
    opacity: float
    texture: int
    glow: int = -1


def solids(model: mujoco.MjModel, targets: set[TargetId], segments: int = 12) -> list[Solid]:
    """Everything that is drawn of a model, except its targets.

    `segments` is the number of edges of round shapes to a right angle.
    """
    geoms = [geom for geom in visible_geoms(model) if geom not in targets]
    return [_solid(model, visual, make(segments)) for visual, (_, make) in visuals_of(model, geoms)]


def target_finish(
    source: Source, name: str, mesh: MovingMesh
) -> tuple[Finish, NDArray[np.float64] | None]:
    """How a target looks, and the places [m, 3, 2] of its mesh's corners in its flat texture.

    It looks as in the renderer. The places are None without a flat texture; see `Solid`.
    """
    model = source.model
    geom = source.ripples.geom_ids[name]
    finish = _finish(model, *painted(model, geom, *source.paints[name], mesh.uv is not None))
    if finish.texture < 0:
        return finish, None
    visual = target_visual(model, geom)
    mapping = mapping_of(model, visual)
    finish = finish._replace(glow=glow_texture(model, visual, mapping))
    if not mapping.own or mesh.uv is None:
        return finish, texture_places(mapping, mapping.at(mesh.rest.astype(np.float64))[mesh.F])
    # v from the upper edge
    return finish, texture_places(mapping, np.array([0.0, 1.0]) + np.array([1.0, -1.0]) * mesh.uv)


def _finish(
    model: mujoco.MjModel,
    look: Look,
    color: NDArray[np.float64],
    mapping: TextureMapping,
    opacity: float = 1.0,
) -> Finish:
    """Surface with a flat texture, or else the mean colour of any other."""
    if mapping.kind == MappingKind.FLAT_IMAGE:
        return Finish(look, color, opacity, mapping.texture)
    return Finish(look, color * mean_color(model, mapping), opacity, -1)


def texture_places(
    mapping: TextureMapping, coordinates: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Places [..., 2] in a flat texture, v from its lower edge, for coordinates of a mapping.

    The coordinates are [..., 2 or 3].
    """
    places = coordinates[..., :2] * mapping.tiling[:2] + mapping.tiling[2:]
    return np.stack([places[..., 0], 1.0 - places[..., 1]], axis=-1)


def triangle_opacities(
    model: mujoco.MjModel, finish: Finish, count: int, uv: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Opacities of `count` triangles in the middle, [m]; their corners' places are [m, 3, 2]."""
    if uv is None or finish.texture < 0 or not texture_has_opacity(model, finish.texture):
        return np.full(count, finish.opacity)
    pixels = texture_pixels_with_opacity(model, finish.texture)
    height, width, _ = pixels.shape
    u, v = uv.mean(axis=1).T
    column = np.floor(u * width).astype(np.int64) % width
    row = np.floor((1.0 - v) * height).astype(np.int64) % height
    return np.asarray(finish.opacity * pixels[row, column, 3] / 255)


def mean_color(model: mujoco.MjModel, mapping: TextureMapping) -> NDArray[np.float64]:
    """Mean linear colour of a mapping's texture [3], white without one."""
    if mapping.texture < 0:
        return np.ones(3)
    pixels = texture_pixels(model, mapping.texture)[::4, ::4]
    return srgb_to_linear(pixels / 255.0).mean(axis=(0, 1))


def _solid(model: mujoco.MjModel, visual: Visual, mesh: Shape) -> Solid:
    points = mesh.positions(*sizes(model, visual))
    mapping = mapping_of(model, visual)
    uv = None
    if mapping.kind == MappingKind.FLAT_IMAGE:
        # a mesh asset counts v as MuJoCo does, from the upper edge
        coordinates = mesh.uv if mapping.own and mesh.uv is not None else mapping.at(points)
        uv = texture_places(mapping, coordinates)[mesh.faces]
    element = model.site(visual.index) if visual.site else model.geom(visual.index)
    name = element.name or f"site {visual.index}"
    if not visual.site:
        name = geom_name(model, geom_id(visual.index))
    position = np.array(element.pos)
    quaternion = np.array(element.quat)
    normals = normalized(mesh.normals)
    if visual.kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:  # the ball's normals, stretched
        normals = normalized(normals / visual.half_sizes)
    finish = _finish(model, look_of(model, visual), visual.color, mapping, visual.opacity)
    return Solid(
        finish, name, int(element.bodyid[0]), position, quaternion, points, normals, mesh.faces, uv
    )
