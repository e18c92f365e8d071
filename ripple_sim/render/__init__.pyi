from .bounds import (
    balls_about as balls_about,
    boxes_of as boxes_of,
    enclosing as enclosing,
    scissor_of as scissor_of,
    within as within,
)
from .camera import (
    Camera as Camera,
    FixedCamera as FixedCamera,
    Viewpoint as Viewpoint,
    find_viewpoint as find_viewpoint,
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
from .drawn_scene import DrawnScene as DrawnScene
from .frame_pass import FramePass as FramePass
from .frame_uniforms import FrameUniforms as FrameUniforms
from .g_buffer import GBuffer as GBuffer
from .height_map_textures import (
    AnyHeightMap as AnyHeightMap,
    HeightMapTextures as HeightMapTextures,
    MovedHeightMap as MovedHeightMap,
    write_page as write_page,
)
from .mujoco_cameras import (
    mujoco_camera as mujoco_camera,
    pose_of_scene as pose_of_scene,
    set_scene_camera as set_scene_camera,
)
from .pose import Pose as Pose, view_matrix as view_matrix
from .projection import orthographic as orthographic, perspective as perspective
from .readback import FrameFormat as FrameFormat, Readback as Readback
from .renderer import Renderer as Renderer
from .resources import Resources as Resources
from .srgb_textures import (
    SRGB8_ALPHA8 as SRGB8_ALPHA8,
    fitted as fitted,
    srgb_cube as srgb_cube,
    srgb_texture as srgb_texture,
)
from .surface_image import SurfaceBuffers as SurfaceBuffers, SurfaceImage as SurfaceImage
from .surface_mesh import SurfaceMesh as SurfaceMesh
from .surfaces.surface import Surface as Surface
from .tone_mapping import (
    linear_to_srgb as linear_to_srgb,
    srgb_to_linear as srgb_to_linear,
    tone_mapped as tone_mapped,
)
from .visuals.scene_light import LIGHTING as LIGHTING
from .visuals.visual import LOOKS as LOOKS
