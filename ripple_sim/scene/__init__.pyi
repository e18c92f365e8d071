from .bodies import (
    BODY_SHAPES as BODY_SHAPES,
    RandomEntry as RandomEntry,
    drop_model as drop_model,
    randomize as randomize,
)
from .camera_entry import (
    MAX_EXPOSURES as MAX_EXPOSURES,
    CameraEntry as CameraEntry,
    CameraKey as CameraKey,
    check_camera as check_camera,
)
from .drop import drop_scene as drop_scene, find_scene as find_scene, is_scene as is_scene
from .drop_view import VIEWS as VIEWS
from .events import (
    DropEntry as DropEntry,
    Events as Events,
    PlaceEntry as PlaceEntry,
    PokeEntry as PokeEntry,
    Script as Script,
    ThrowEntry as ThrowEntry,
    check_time as check_time,
    free_joint as free_joint,
)
from .loading import (
    check_files as check_files,
    check_scene as check_scene,
    load_model as load_model,
    load_scene as load_scene,
    refusal_of as refusal_of,
)
from .material_entry import (
    LAWS as LAWS,
    MapEntry as MapEntry,
    MaterialChange as MaterialChange,
    MaterialEntry as MaterialEntry,
    PresetEntry as PresetEntry,
)
from .material_images import image_pixels as image_pixels, load_image as load_image
from .overlays import (
    HEATMAPS as HEATMAPS,
    NAMES as NAMES,
    Request as Request,
    parse_request as parse_request,
)
from .paint import paint_target as paint_target
from .scene import (
    MAX_DURATION as MAX_DURATION,
    MAX_SLOW_MOTION as MAX_SLOW_MOTION,
    Scene as Scene,
    check_duration as check_duration,
    through_camera as through_camera,
    with_exposure as with_exposure,
)
from .scene_file import (
    RippleEntry as RippleEntry,
    SceneFile as SceneFile,
    StillEntry as StillEntry,
    apply_maps as apply_maps,
    parse_scene as parse_scene,
    uniform_material as uniform_material,
)
from .source import (
    read_toml as read_toml,
    scene_path as scene_path,
    shipped_scenes as shipped_scenes,
)
from .standing import UP_AXES as UP_AXES, usual_up as usual_up
from .target_maps import (
    HeightEntry as HeightEntry,
    InsideEntry as InsideEntry,
    evaluate as evaluate,
    load_inside as load_inside,
)
