"""What Blender is told beside the stage: frames, sky, soft boxes, and the floor that fades into the sky."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from ripple_sim.export.source import Source
from ripple_sim.export.visuals import mean_color
from ripple_sim.render.passes.floor import find_floor
from ripple_sim.render.visuals.lights import is_lit, model_lighting
from ripple_sim.render.visuals.studio import (
    BESIDE_LIGHTS,
    FADE,
    SOFT_BOX_LIGHTS,
    STUDIO_FADE,
    sky_colors,
    studio_lighting,
)
from ripple_sim.render.visuals.texture_mapping import mapping_of
from ripple_sim.render.visuals.visual import geom_visual, visible_geoms

# what the renderer's soft boxes give to diffuse surfaces, over what lights of their size and radiance would
_DIFFUSE_SHARE = 0.13 * np.pi / 4


def blender_settings(source: Source, data: mujoco.MjData) -> dict[str, Any]:
    """Light and background of a source at its first frame, and its camera's shutter and size, as JSON has them."""
    model = source.model
    pose, _ = source.pose(data)
    studio = source.lighting == "studio" or (source.lighting == "auto" and not is_lit(model))
    lighting = studio_lighting(pose) if studio else model_lighting(model, data, pose)
    floor = find_floor(model, [geom for geom in visible_geoms(model) if geom not in source.ripples.geom_ids.values()])
    albedo = None
    if floor is not None:
        visual = geom_visual(model, floor)
        albedo = visual.color * mean_color(model, mapping_of(model, visual))
    sky = sky_colors(lighting, pose, albedo, None)
    strength = 1.0 if studio else BESIDE_LIGHTS
    return {
        "size": list(source.size),
        "fps": source.fps,
        "shutter": source.camera.shutter / 360,
        "distance": pose.distance,
        "horizon": sky.horizon.tolist(),
        "zenith": sky.zenith.tolist(),
        "sky": sky.light.tolist(),
        "floor": None
        if floor is None
        else mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, floor) or f"geom_{floor}",
        "fade": list(STUDIO_FADE if studio else FADE),
        "boxes_reflected": strength,
        "boxes_diffuse": _DIFFUSE_SHARE * strength if studio else 0.0,
        "boxes": [
            {"azimuth": azimuth, "elevation": elevation, "half": [width, height], "radiance": list(radiance)}
            for azimuth, elevation, width, height, radiance in SOFT_BOX_LIGHTS
        ],
    }
