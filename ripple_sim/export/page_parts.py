"""The meshes of a page: targets at rest and solid geoms, with their looks; floor and light."""

from __future__ import annotations

import base64
import io
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.coupling.ids import GeomId, is_geom
from ripple_sim.render.surfaces.vertices import memory_order
from ripple_sim.render.visuals.scene_light import lighting_of
from ripple_sim.render.visuals.studio import SOFT_BOX_LIGHTS
from ripple_sim.render.visuals.texture_mapping import mapping_of
from ripple_sim.render.visuals.visual import (
    geom_visual,
    texture_is_half_clear,
    texture_pixels_with_opacity,
)

from .moving_mesh import MovingMesh
from .source import Source
from .visuals import Finish, Solid, mean_color, target_finish, triangle_opacities

_MAX_IMAGE_SIZE = 1024  # of a texture, along a side [pixels]
_JPEG_QUALITY = 88
# Mean error of a JPEG, of 255, above which a texture comes without loss: images with small squares
# of different colours, such as those of vertices.
_MAX_JPEG_ERROR = 3.0
# Opacity from which a triangle casts a shadow.
_CASTING_OPACITY = 0.5


class PagePart(NamedTuple):
    """A mesh of a page.

    Attributes
    ----------
    meta : dict
        Its description, for the page's JSON.
    arrays : list
        Its coded arrays.
    F : int64 [m, 3]
        Triangles.
    vertices : int64 [n]
        Numbers that its vertices have in the source.
    """

    meta: dict[str, Any]
    arrays: list[NDArray]
    F: NDArray[np.int64]
    vertices: NDArray[np.int64]


def target_part(source: Source, name: str, mesh: MovingMesh) -> PagePart:
    """A target at rest; its points follow along `directions`, and with its mesh's own vertices."""
    model = source.model
    geom = source.ripples.geom_ids[name]
    finish, uv = target_finish(source, name, mesh)
    soft = not is_geom(geom, model)  # and so in the world
    meta = {
        "name": name,
        "target": True,
        "body": 0 if soft else int(model.geom_bodyid[geom]),
        "position": [0, 0, 0] if soft else model.geom_pos[geom].tolist(),
        "quaternion": [1, 0, 0, 0] if soft else model.geom_quat[geom].tolist(),
        "open": not source.ripples[name].atlas.mesh.closed,
    }
    return _part(model, meta, finish, mesh.F, [mesh.rest, mesh.directions], uv)


def floor_of(model: mujoco.MjModel, geom: GeomId) -> dict[str, Any]:
    """The floor: height, albedo and texture."""
    visual = geom_visual(model, geom)
    mapping = mapping_of(model, visual)
    return {
        "body": int(model.geom_bodyid[geom]),
        "position": model.geom_pos[geom].tolist(),
        "quaternion": model.geom_quat[geom].tolist(),
        "half": [float(x) if x > 0 else 0.0 for x in visual.size[:2]],
        "color": visual.color.tolist(),
        "mean": (visual.color * mean_color(model, mapping)).tolist(),
        "texture": mapping.texture if mapping.texture >= 0 else -1,
        "tiling": list(mapping.tiling),
    }


def light_of(source: Source, data: mujoco.MjData) -> dict[str, Any]:
    """Lamps, soft boxes and ambient light, as the renderer has them at the first frame."""
    pose = source.pose(data)
    lighting = lighting_of(source.model, data, pose, source.lighting)
    studio = lighting.studio
    lamps = [
        {
            # in the camera's frame where the lamp turns with it
            "direction": light.direction.tolist(),
            "head": bool(
                not studio
                and np.allclose(light.direction, pose.rotation[:, 2])
                and light.position is None
            ),
            "radiance": light.radiance.tolist(),
            "position": None if light.position is None else light.position.tolist(),
            "size": light.size,
            "cutoff": float(np.cos(light.cutoff)),
            "exponent": light.exponent,
            "falloff": light.falloff.tolist(),
            "gloss": light.gloss,
            "shadow": light.shadow,
        }
        for light in lighting.lights[:4]
    ]
    return {
        "studio": studio,
        "lamps": lamps,
        "ambient": lighting.ambient.tolist(),
        "boxes": [[*map(float, box[:4]), *map(float, box[4])] for box in SOFT_BOX_LIGHTS],
    }


def solid_part(model: mujoco.MjModel, solid: Solid) -> PagePart:
    """A solid geom."""
    meta = {
        "name": solid.name,
        "target": False,
        "body": solid.body,
        "position": solid.position.tolist(),
        "quaternion": solid.quaternion.tolist(),
        "open": False,
    }
    return _part(model, meta, solid.finish, solid.F, [solid.points, solid.normals], solid.uv)


def _part(
    model: mujoco.MjModel,
    meta: dict[str, Any],
    finish: Finish,
    F: NDArray,
    fields: list[NDArray],
    uv: NDArray | None,
) -> PagePart:
    """Code points and directions in 16 bits each, triangles, and corners' texture coordinates.

    The triangles that cast shadows come first.
    """
    F, vertices, triangles = memory_order(F, fields[0])
    casts = triangle_opacities(model, finish, len(F), uv)[triangles] >= _CASTING_OPACITY
    casting_first = np.argsort(~casts, kind="stable")
    F = F[casting_first]
    triangles = triangles[casting_first]
    points, directions = (np.asarray(field, np.float64)[vertices] for field in fields)
    low = points.min(axis=0)
    size = max(float(np.ptp(points, axis=0).max()), 1e-9)
    place = np.rint((points - low) / size * 65535).astype("<u2")
    arrays = [place, np.rint(directions * 32767).astype("<i2"), F.astype("<u4")]
    if uv is not None:
        arrays.append(np.asarray(uv, "<f4")[triangles])
    counts = {
        "points": len(points),
        "triangles": len(F),
        "casting": int(casts.sum()),
        "textured": uv is not None,
    }
    return PagePart(
        {**meta, **look_meta(model, finish), "low": low.tolist(), "size": size, **counts},
        arrays,
        F,
        vertices,
    )


def look_meta(model: mujoco.MjModel, finish: Finish) -> dict[str, Any]:
    """How a part looks, for its description."""
    names = ("roughness", "metallic", "sheen", "coat", "translucency", "transparency", "emission")
    return {
        "color": finish.color.tolist(),
        "opacity": finish.opacity,
        "texture": finish.texture,
        "glow": finish.glow,
        "clear": finish.texture >= 0 and texture_is_half_clear(model, finish.texture),
        **{name: float(getattr(finish.look, name)) for name in names},
    }


def data_uri(model: mujoco.MjModel, texture: int) -> str:
    """A texture of the model as a picture within the page."""
    image = Image.fromarray(texture_pixels_with_opacity(model, texture))
    image.thumbnail((_MAX_IMAGE_SIZE, _MAX_IMAGE_SIZE))
    kind = "jpeg"
    content = b"" if image.mode == "RGBA" else _encoded(image, kind)
    if not content or _mean_error(content, image) > _MAX_JPEG_ERROR:
        kind = "webp"
        content = _encoded(image, kind)
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"


def _encoded(image: Image.Image, kind: str) -> bytes:
    """An image as JPEG, or as WebP without loss."""
    file = io.BytesIO()
    options = {"quality": _JPEG_QUALITY} if kind == "jpeg" else {"lossless": True}
    image.save(file, kind, **options)
    return file.getvalue()


def _mean_error(content: bytes, image: Image.Image) -> float:
    """Mean difference of an encoded image from its pixels, of 255."""
    with Image.open(io.BytesIO(content)) as decoded:
        difference = np.asarray(decoded, np.int16) - np.asarray(image, np.int16)
    return float(np.abs(difference).mean())
