"""What of a page stays the same over time: meshes, looks, textures, camera and light."""

from __future__ import annotations

import base64
import io
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.coupling.soft_ids import is_soft
from ripple_sim.overlay.colormap import color_table
from ripple_sim.render.visuals.lights import is_lit, model_lighting
from ripple_sim.render.visuals.materials import texture_pixels
from ripple_sim.render.visuals.studio import SOFT_BOX_LIGHTS, studio_lighting

from .moving_mesh import MovingMesh
from .ordering import local_order
from .source import Source
from .visuals import Finish, Solid, solid_finish, solids, target_finish, target_uv

_TRIANGLES, _SEGMENTS = 16_000, 6  # of a target, and of a primitive to a right angle
_LARGEST_IMAGE = 1024  # [pixels]


class Part(NamedTuple):
    """A mesh of a page: what describes it, its arrays, its triangles, and which vertices of the source are its own."""

    meta: dict[str, Any]
    arrays: list[NDArray]
    F: NDArray[np.int64]
    vertices: NDArray[np.int64]


def target_mesh(source: Source, name: str) -> MovingMesh:
    """The surface of a target as the page shows it."""
    return MovingMesh(source.ripples[name].rest, source.tessellation, source.limited[name], _TRIANGLES)


def target_part(source: Source, name: str, mesh: MovingMesh) -> Part:
    """A target at rest; its points follow along `directions`, and with its mesh's own vertices."""
    model, geom = source.model, source.ripples.geom_ids[name]
    finish = target_finish(model, geom, source.paints[name], mesh.uv is not None)
    uv = target_uv(model, geom, mesh) if finish.texture >= 0 else None
    soft = is_soft(model, geom)  # and so in the world
    meta = {
        "name": name,
        "target": True,
        "body": 0 if soft else int(model.geom_bodyid[geom]),
        "position": [0, 0, 0] if soft else model.geom_pos[geom].tolist(),
        "quaternion": [1, 0, 0, 0] if soft else model.geom_quat[geom].tolist(),
        "open": not source.ripples[name].atlas.mesh.closed,
        **_look(finish),
    }
    return _part(meta, mesh.F, [mesh.rest, mesh.directions], uv)


def solid_parts(source: Source, floor: int) -> list[Part]:
    """Everything else but the floor, which is a geom id."""
    model = source.model
    found = solids(model, {*source.ripples.geom_ids.values(), floor}, _SEGMENTS)
    return [_solid_part(model, solid) for solid in found]


def images(model: mujoco.MjModel, parts: list[dict[str, Any]]) -> dict[int, str]:
    """Textures that parts use, as data URIs, by their ids."""
    return {part["texture"]: _data_uri(model, part["texture"]) for part in parts if part["texture"] >= 0}


def floor_of(model: mujoco.MjModel, geom: int | None) -> dict[str, Any] | None:
    """The floor: height, albedo and texture."""
    if geom is None:
        return None
    from ripple_sim.render.visuals.texture_mapping import mapping_of
    from ripple_sim.render.visuals.visual import geom_visual

    from .visuals import mean_color

    visual = geom_visual(model, geom)
    mapping = mapping_of(model, visual)
    half = [float(x) if x > 0 else 0.0 for x in visual.size[:2]]
    return {
        "body": int(model.geom_bodyid[geom]),
        "position": model.geom_pos[geom].tolist(),
        "quaternion": model.geom_quat[geom].tolist(),
        "half": half,
        "color": visual.color.tolist(),
        "mean": (visual.color * mean_color(model, mapping)).tolist(),
        "texture": mapping.texture if mapping.texture >= 0 else -1,
        "tiling": list(mapping.tiling),
    }


def light_of(source: Source, data: mujoco.MjData) -> dict[str, Any]:
    """Lamps, soft boxes and ambient light, as the renderer has them at the first frame."""
    pose, _ = source.pose(data)
    studio = source.lighting == "studio" or (source.lighting == "auto" and not is_lit(source.model))
    lighting = studio_lighting(pose) if studio else model_lighting(source.model, data, pose)
    lamps = [
        {
            # in the camera's frame where the lamp turns with it
            "direction": light.direction.tolist(),
            "head": bool(not studio and np.allclose(light.direction, pose.rotation[:, 2]) and light.position is None),
            "radiance": light.radiance.tolist(),
            "position": None if light.position is None else light.position.tolist(),
            "cutoff": float(np.cos(light.cutoff)),
            "exponent": light.exponent,
            "falloff": light.falloff.tolist(),
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


def heat_colors() -> list[list[int]]:
    """Colours of the heights, from the lowest to the highest, sRGB."""
    return color_table()[::8].tolist()


def _solid_part(model: mujoco.MjModel, solid: Solid) -> Part:
    meta = {
        "name": solid.name,
        "target": False,
        "body": solid.body,
        "position": solid.position.tolist(),
        "quaternion": solid.quaternion.tolist(),
        "open": False,
        **_look(solid_finish(model, solid.visual)),
    }
    return _part(meta, solid.F, [solid.points, solid.normals], solid.uv)


def _look(finish: Finish) -> dict[str, Any]:
    look = finish.look
    names = ("roughness", "metallic", "sheen", "coat", "translucency", "transparency", "emission")
    values = {name: float(getattr(look, name)) for name in names}
    return {"color": finish.color.tolist(), "opacity": finish.opacity, "texture": finish.texture, **values}


def _part(meta: dict[str, Any], F: NDArray, fields: list[NDArray], uv: NDArray | None) -> Part:
    """Points and directions in 16 bits each, triangles, and texture coordinates of their corners."""
    triangles, vertices, F = local_order(fields[0], F)
    points, directions = (np.asarray(field, np.float64)[vertices] for field in fields)
    low, size = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-9)
    place = np.rint((points - low) / size * 65535).astype("<u2")
    arrays = [place, np.rint(directions * 32767).astype("<i2"), F.astype("<u4")]
    if uv is not None:
        arrays.append(np.asarray(uv, "<f4")[triangles])
    counts = {"points": len(points), "triangles": len(F), "textured": uv is not None}
    return Part({**meta, "low": low.tolist(), "size": size, **counts}, arrays, F, vertices)


def _data_uri(model: mujoco.MjModel, texture: int) -> str:
    image = Image.fromarray(texture_pixels(model, texture))
    image.thumbnail((_LARGEST_IMAGE, _LARGEST_IMAGE))
    file = io.BytesIO()
    image.save(file, "JPEG", quality=88) if image.width > 64 else image.save(file, "PNG")
    kind = "jpeg" if image.width > 64 else "png"
    return f"data:image/{kind};base64,{base64.b64encode(file.getvalue()).decode()}"
