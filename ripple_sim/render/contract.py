"""The contract between the renderer and its shaders: units, bindings, struct layouts, numbers.

Every shader gets the contract as defines; see `DEFINES`.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any, TypeAlias

import numpy as np

from .tone_mapping import CURVES

# Greatest number of lights of a frame, and of lights that cast shadows.
MAX_LIGHTS = 8
MAX_SHADOWS = 4

# Greatest number of geoms that darken the ambient light of objects near them.
MAX_OCCLUDERS = 16

# Soft boxes of the studio.
SOFT_BOXES = 3

# Lights whose uniforms reach fragments as varyings.
HELD_LIGHTS = 2

# Objects in a row of the table of objects; a power of two.
OBJECT_COLUMNS = 64

# Depths that stand for the contents of a pixel, exact in every depth buffer; `NAME_LEVEL` in GLSL.
LEVELS = {
    "OPEN": 1.0,  # background that is smooth
    "SHADED": 0.75,  # background that a shadow may reach, or that is not smooth
    "MIXED": 0.5,  # solids in some of the samples
    "SOLID": 0.25,  # solids in all of them
    "LAYER": 0.125,  # the transparent object that is being drawn
}

# Shapes, in float32, of types that std140 and std430 lay out alike. The columns of a mat3 are
# padded to four numbers.
_SHAPES: dict[str, tuple[int, ...]] = {"vec4": (4,), "mat3": (3, 4), "mat4": (4, 4)}


class Unit(IntEnum):
    """Texture units; `NAME_UNIT` in GLSL."""

    HEIGHT_MAPS = 0
    SHADOW_TEST = 1  # the shadow maps, compared with a depth
    SHADOW_MAPS = 2
    FLOOR_MAP = 3  # ambient visibility of the floor
    CEILING = 4  # how high above the floor the lowest geoms hang, and of which colour they are
    FLAT_IMAGE = 5
    CUBE_IMAGE = 6
    SKYBOX = 7
    DEPTHS = 8  # the G-buffer: depths, then its two colour attachments
    NORMALS = 9
    COLORS = 10
    BEHIND = 11  # the frame without the transparent object that is being drawn
    HEATMAP = 12
    HEATMAP_COLORS = 13
    MIRROR = 14
    COARSE_BACKGROUND = 15
    BLOCKERS = 16  # what the shadow maps hold, prefiltered
    FLOOR_BOUNCE = 17  # light that objects throw on the floor
    TRANSMISSION = 18  # what transparent objects take from the lights
    OBJECTS = 19  # the table of objects
    FLOOR_SEEN = 20  # the floor's light as solids see it
    TILE_KINDS = 21  # how each tile of the background is filled
    HORIZON = 22  # colours of the skybox along its horizon
    GLOW_IMAGE = 23  # what a target emits, by its texture coordinates


class Binding(IntEnum):
    """Bindings of storage buffers and uniform blocks; `NAME_BINDING` in GLSL.

    OpenGL promises eight of the former, and names for the same number are aliases.
    """

    # uniform blocks
    FRAME = 3
    OCCLUDERS = 4
    # storage buffers, of adaptive tessellation on the GPU
    SPLIT = 0
    LONG_EDGES = 1
    LOOKUPS = 2
    FACES = 3
    BEFORE = 4
    TOTALS = 5
    INDICES = 6
    COMMAND = 7


class MappingKind(IntEnum):
    """How a texture lies on an object; the same names in GLSL."""

    NO_IMAGE = 0
    FLAT_IMAGE = 1  # by texture coordinates
    CUBE_IMAGE = 2
    BOX_IMAGE = 3  # flat ones wrapped round a primitive
    BALL_IMAGE = 4
    CYLINDER_IMAGE = 5
    CAPSULE_IMAGE = 6


class Texels(IntEnum):
    """Which texels of a target's texture are drawn, by their opacity; the same names in GLSL."""

    ALL_TEXELS = 0  # the texture has no opacity
    HALF_OPAQUE_TEXELS = 1  # those that are more than half opaque, and then count as opaque
    OPAQUE_TEXELS = 2
    CLEAR_TEXELS = 3  # those that show what is behind them, but not fully


class CasterMap(IntEnum):
    """Kinds of maps in which a light or the floor sees objects; `NAME_MAP` in GLSL."""

    DEPTH = 0
    ALBEDO = 1  # linear colour
    TRANSMISSION = 2  # what something transparent takes from a light


Member: TypeAlias = "str | Struct | tuple[str | Struct, int]"


class Struct:
    """A struct in GLSL, and the NumPy dtype of the same layout.

    The layout is that of uniform blocks (std140) and storage buffers (std430).

    Parameters
    ----------
    name : str
        Name in GLSL.
    **members
        Type of each member: "vec4", "mat3", "mat4" or another struct; for an array, a pair of the
        type and the length.

    Attributes
    ----------
    dtype : numpy.dtype
        Matrices are stored column by column: a mat4 is [column, row], a mat3 [column, row and
        padding].
    members : str
        The declarations, to be put between the braces of a struct or block.
    """

    def __init__(self, name: str, /, **members: Member) -> None:
        self.name = name
        fields: list[tuple[Any, ...]] = []
        declarations = []
        for member, declared in members.items():
            kind, count = declared if isinstance(declared, tuple) else (declared, None)
            type_name: str
            base: Any
            shape: tuple[int, ...]
            if isinstance(kind, str):
                type_name = kind
                base = "f4"
                shape = _SHAPES[kind]
            else:
                type_name = kind.name
                base = kind.dtype
                shape = ()
            if count is None:
                declarations.append(f"{type_name} {member};")
                fields.append((member, base, shape))
            else:
                declarations.append(f"{type_name} {member}[{count}];")
                fields.append((member, base, (count, *shape)))
        self.dtype: np.dtype[Any] = np.dtype(fields)
        self.members = " ".join(declarations)


def numbered(names: type[IntEnum], suffix: str = "") -> dict[str, int]:
    """Defines for the names of an enumeration, including aliases, each with a suffix."""
    return {f"{name}{suffix}": member.value for name, member in names.__members__.items()}


LIGHT = Struct(
    "Light",
    position="vec4",  # xyz [m]; w: 1 for a light at a position, 0 for one far away
    # towards the light, or against the beam of a spotlight; w: cosine of the beam's half angle
    direction="vec4",
    radiance="vec4",  # of a white surface facing the light; w: exponent of the beam
    # attenuation: constant, linear [1/m], quadratic [1/m^2]; share of the radiance in highlights
    falloff="vec4",
)
SHADOW = Struct(
    "Shadow",
    matrix="mat4",  # world to shadow map, all three coordinates 0 to 1 after the division
    planes="mat4",  # its inverse transpose, which transforms planes
    # (x z + y) / (z z + w) turns a depth of the map into the distance from the light [m]
    depth="vec4",
    width="vec4",  # x + y times that distance: the map's width [m]; z: its texels
    # x: tangent of the light's angular radius; y: radius of a near light [m]; z: widest, in the map
    penumbra="vec4",
    # bounding box of the shadows on the floor, in the floor map: lower and upper corner
    floor="vec4",
)
FRAME = Struct(
    "Frame",
    view_projection="mat4",
    eye="vec4",  # xyz [m]; w: distance of the focus [m]
    # the point that the camera is about [m]; w: how far away the floor begins to show [m]
    focus="vec4",
    # through the middle of the frame, one metre along the camera's axis; w: near plane [m]
    ray="vec4",
    ray_right="vec4",  # from there to the frame's right edge; w: far plane [m]
    # likewise; w: 1 where rays are parallel and start beside each other, 0 in perspective
    ray_up="vec4",
    zenith="vec4",  # radiance of the background overhead
    horizon="vec4",
    sky="vec4",  # ambient radiance from above; w: share of the soft boxes in it
    soft_box_normal=("vec4", SOFT_BOXES),  # towards the middle; w: half the width over the distance
    soft_box_tangent=("vec4", SOFT_BOXES),  # horizontal axis; w: half the height over the distance
    soft_box_radiance=("vec4", SOFT_BOXES),
    floor_origin="vec4",  # xyz [m]; w: 1 with a floor, 0 without
    floor_u="vec4",  # axes of the floor; w: its half sizes [m]
    floor_v="vec4",
    floor_normal="vec4",
    floor_albedo="vec4",  # mean
    floor_light="vec4",  # irradiance over pi where nothing shades the floor
    floor_map="vec4",  # the floor map: xy centre, z half width [m]
    # x, y: where it begins and ends to fade into the background, in distances of the focus
    floor_fade="vec4",
    lights=(LIGHT, MAX_LIGHTS),  # the first ones cast shadows
    shadows=(SHADOW, MAX_SHADOWS),
    # without a backdrop, colours in sRGB
    fog="vec4",  # its colour; w: 1 with fog
    haze="vec4",  # the colour of the haze over the floor's horizon; w: 1 with haze
    # x: its width, y: how high it is densest (see background.glsl), z: how far the skybox is [m]
    haze_cone="vec4",
    shown_far="vec4",  # x, y: where fog begins and is complete [m]; z: 1 where the skybox is shown
    counts="vec4",  # y: lights, z: number of the exposure, w: lights that cast shadows
)


class Shading(IntEnum):
    """How the light on an object is computed."""

    BACK_AS_FRONT = -1  # the back of a sheet is as bright as its front
    USUAL = 0
    HEATMAP = 1  # colours are shown as they are, except for shadows
    UNLIT = 2  # colours are shown as they are
    CLEAR = 3  # each texel has an opacity of its own, which the G-buffer has in place of ink
    GLOWING = 4  # the G-buffer has the emitted share of the colour in place of ink


OBJECT = Struct(
    "Object",
    base="vec4",  # roughness, metallic, sheen, coat
    volume="vec4",  # translucency, transparency, emission, opacity
    # geom, size [m], shadow bias [m], one of `Shading`
    place="vec4",
    # layer; 1 with a height map, 0 without; bits of the occluders near a geom; a chart's side with
    # its halo [texels]
    height_map="vec4",
    rotation="mat3",  # of the height map's gradients, into the world
)

DEFINES: dict[str, object] = {
    "MAX_LIGHTS": MAX_LIGHTS,
    "MAX_OCCLUDERS": MAX_OCCLUDERS,
    "HELD_LIGHTS": HELD_LIGHTS,
    "SOFT_BOXES": SOFT_BOXES,
    **numbered(Unit, "_UNIT"),
    **numbered(Binding, "_BINDING"),
    **numbered(MappingKind),
    **numbered(Texels),
    **numbered(CasterMap, "_MAP"),
    **numbered(Shading, "_SHADING"),
    **{f"{name}_LEVEL": level for name, level in LEVELS.items()},
    **{
        f"{struct.name.upper()}_MEMBERS": struct.members
        for struct in (LIGHT, SHADOW, FRAME, OBJECT)
    },
    # defaults, which passes may override
    "BACKDROP": 1,
    "TEXELS": int(Texels.ALL_TEXELS),
    "GLOW": 0,
    "HORIZON": 0,
    "OBJECT_TEXELS": OBJECT.dtype.itemsize // 16,
    "OBJECT_COLUMNS": OBJECT_COLUMNS,
    **CURVES,
}
