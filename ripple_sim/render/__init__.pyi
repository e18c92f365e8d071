from .camera import (
    Camera as Camera,
    FixedCamera as FixedCamera,
    Pose as Pose,
    Viewpoint as Viewpoint,
    balls_about as balls_about,
    boxes_of as boxes_of,
    enclosing as enclosing,
    find_viewpoint as find_viewpoint,
    mujoco_camera as mujoco_camera,
    orthographic as orthographic,
    perspective as perspective,
    pose_of_scene as pose_of_scene,
    scissor_of as scissor_of,
    set_scene_camera as set_scene_camera,
    view_matrix as view_matrix,
    within as within,
)
from .contract import (
    DEFINES as DEFINES,
    FRAME as FRAME,
    LEVELS as LEVELS,
    MAX_LIGHTS as MAX_LIGHTS,
    MAX_OCCLUDERS as MAX_OCCLUDERS,
    MAX_SHADOWS as MAX_SHADOWS,
    OBJECT as OBJECT,
    OBJECT_COLUMNS as OBJECT_COLUMNS,
    Binding as Binding,
    MappingKind as MappingKind,
    Struct as Struct,
    Unit as Unit,
    numbered as numbered,
)
from .drawn_scene import DrawnScene as DrawnScene, SurfaceMesh as SurfaceMesh
from .renderer import Renderer as Renderer
from .resources import (
    SRGB8_ALPHA8 as SRGB8_ALPHA8,
    AnyHeightMap as AnyHeightMap,
    FrameUniforms as FrameUniforms,
    HeightMapTextures as HeightMapTextures,
    MovedHeightMap as MovedHeightMap,
    Resources as Resources,
    fitted as fitted,
    srgb_cube as srgb_cube,
    srgb_texture as srgb_texture,
    write_page as write_page,
)
from .surfaces.surface import Surface as Surface
from .targets import (
    FrameFormat as FrameFormat,
    FramePass as FramePass,
    GBuffer as GBuffer,
    Readback as Readback,
    SurfaceBuffers as SurfaceBuffers,
    SurfaceImage as SurfaceImage,
)
from .tone_mapping import (
    linear_to_srgb as linear_to_srgb,
    srgb_to_linear as srgb_to_linear,
    tone_mapped as tone_mapped,
)
from .visuals.lights import LIGHTING as LIGHTING
from .visuals.visual import LOOKS as LOOKS
