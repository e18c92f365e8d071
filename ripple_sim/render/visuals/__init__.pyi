from .corners import (
    bake as bake,
    bounding_radius as bounding_radius,
    cast as cast,
    corner_normals as corner_normals,
    frames_about as frames_about,
    normalized as normalized,
    smooth_normals as smooth_normals,
    split_corners as split_corners,
    triangle_normals as triangle_normals,
)
from .geoms import (
    Instances as Instances,
    instances_of as instances_of,
    shaped as shaped,
    visuals_of as visuals_of,
)
from .lights import Light as Light, Lighting as Lighting, model_lighting as model_lighting
from .objects import Assets as Assets, ObjectTable as ObjectTable, Occluders as Occluders
from .scene_entries import visuals_in as visuals_in
from .scene_light import (
    LIGHTING as LIGHTING,
    SceneLight as SceneLight,
    lighting_of as lighting_of,
    set_lighting as set_lighting,
)
from .shapes import shape_of as shape_of, sizes as sizes
from .studio import (
    BESIDE_LIGHTS as BESIDE_LIGHTS,
    FADE as FADE,
    SOFT_BOX_LIGHTS as SOFT_BOX_LIGHTS,
    STUDIO_FADE as STUDIO_FADE,
    sky_colors as sky_colors,
    studio_lighting as studio_lighting,
)
from .texture_mapping import TextureMapping as TextureMapping, mapping_of as mapping_of
from .visual import (
    LOOKS as LOOKS,
    MODEL_LOOK as MODEL_LOOK,
    Look as Look,
    Visual as Visual,
    ball_of as ball_of,
    find_look as find_look,
    geom_visual as geom_visual,
    look_of as look_of,
    site_visual as site_visual,
    texture_pixels as texture_pixels,
    visible_geoms as visible_geoms,
    visible_sites as visible_sites,
)
