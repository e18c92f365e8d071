"""The TOML file of a scene: its tables, read strictly.

`apply_maps` gives a target of `[[ripple]]` the maps of its material, the thickness of its layer,
and its regions without waves.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import re
import typing
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from ripple_sim.coupling.ripples import Ripples
from ripple_sim.errors import SceneError
from ripple_sim.solver import Material, texture_map, thickness_map
from ripple_sim.solver.errors import shown

from .bodies import RandomEntry
from .camera_entry import CameraEntry
from .events import ChangeEntry, ControlEntry, DropEntry, PlaceEntry, PokeEntry, ThrowEntry, Vector
from .material_entry import MaterialEntry
from .target_maps import HeightEntry, InsideEntry, moved

# Largest number in a file, in metres, seconds, newtons or degrees: no sensible scene has larger
# numbers, and their squares do not overflow.
_MAX_NUMBER = 1e12

# A NUL, and halves of surrogate pairs.
_INVALID_CHARACTERS = re.compile("[\0\ud800-\udfff]")

Entry = typing.TypeVar("Entry")

# sRGB, 0 to 1.
Color = tuple[float, float, float]


class StillEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[ripple.still]]`: a disc of the surface without waves."""

    point: Vector
    """In the frame of the geom's body [m]; the nearest point of the surface is taken."""
    radius: float
    """Along the surface [m]."""


class RippleEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """`[[ripple]]`: one target, its material and its look."""

    geom: str
    """Name of the geom, or of its body and its index there: "torso/0"."""
    resolution: int | None = None
    """Texels along the edge of a chart; by default chosen by the model, see `suited_resolution`."""
    layout: str = "auto"
    """How the surface gets its charts: "cube", "patches" or "auto", see `build_atlas`."""
    rim: str | dict[str, str] = "free"
    """Rims of an open surface: waves come back upright from a free one, inverted from one that is
    held. By region, a table such as `rim = {clamped = "x < -0.24"}`: conditions as in
    `ripple.height`, of which the first that holds counts; the rest is free."""
    conserve_volume: bool | None = None
    """Whether the mean of every push is taken out, so that the surface keeps its volume; by default
    on closed surfaces, and on open ones that no rim, clamp or stiffness holds."""
    look: str = "rubber"
    """Look of the surface; `model` is the look of the MJCF's material."""
    color: Color | None = None
    """sRGB, 0 to 1; by default the texture or colour that the MJCF gives the geom, or else the
    look's."""
    material: MaterialEntry = msgspec.field(default_factory=MaterialEntry)
    """The wave equation's coefficients, see below."""
    still: list[StillEntry] = []
    """Discs without waves, see below."""
    still_map: str | None = None
    """Path of an image in the mesh's own texture coordinates: no waves where it is black."""
    inside: list[InsideEntry] = []
    """The body under a layer, see below."""
    height: HeightEntry | None = None
    """The shape of the surface at the beginning, see below; by default it is flat."""
    thickness_limits: tuple[float, float] = (0.0, math.inf)
    """Least and greatest thickness of a layer over what is inside [m]: beyond them it counts as
    these."""
    contacts: list[str] | None = None
    """Geoms that collide for a geom that is only visible; by default the geoms of its body."""
    high_pass: bool = False
    """Whether a flex keeps to itself the coarse motion that contacts give it; its waves get the
    fine rest."""
    pulse: str = "contact"
    """How long a hit takes: `contact`, as MuJoCo holds it, or `hertz`, as two elastic bodies
    touch."""
    modulus: float | None = None
    """For `hertz`: E* of the two materials [Pa], 1 / E* = (1 - nu1^2) / E1 + (1 - nu2^2) / E2."""
    limit: bool = True
    """Limit drawn heights that are too large for the object, and warn of them."""
    warn: bool = True
    """Whether to warn of such heights, and without `limit` of waves too low to be seen, as on drums
    that are only to be heard."""

    def located(self, folder: Path) -> RippleEntry:
        """The same entry, with the paths of its files relative to a folder."""
        return msgspec.structs.replace(
            self,
            material=self.material.located(folder),
            still_map=None if self.still_map is None else str(folder / self.still_map),
            inside=[entry.located(folder) for entry in self.inside],
            height=None if self.height is None else self.height.located(folder),
        )

    def files(self) -> list[str]:
        """Paths of the files and folders that the entry reads, written as in the entry."""
        height = self.height or HeightEntry()
        paths = [self.still_map, height.map, height.field]
        paths += [body.mesh or body.volume for body in self.inside]
        textures = [texture.map for texture in self.material.maps().values()]
        return textures + [path for path in paths if path is not None]


class SensorEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """`[[sensor]]`: a signal from a target's surface, at a site or at points."""

    name: str
    """Name in overlays and exports."""
    geom: str
    """The target."""
    site: str | None = None
    """A site of the MJCF, on the geom's body; or else `point` or `points`."""
    point: Vector | None = None
    """In the frame of the geom's body [m]; the nearest point of the surface is taken."""
    points: list[Vector] = []
    """Several points, such as a grid of taxels."""
    kind: str = "acceleration"
    """`acceleration`, `velocity`, `height` or `strain`."""
    rate: float = 48_000.0
    """Samples a second [1/s]."""
    thickness: float | None = None
    """Of the sheet whose outer face is strained [m], for `strain` alone."""


class SceneFile(msgspec.Struct, forbid_unknown_fields=True):
    """The whole TOML file."""

    model: str
    """Path of the MJCF."""
    ripple: list[RippleEntry]
    """The targets, see below; at least one."""
    duration: float = 5.0
    """Length of the video [s]."""
    two_way: bool = False
    """Let surfaces push back on bodies."""
    lighting: str = "auto"
    """`model`: the MJCF's lamps and skybox; `studio`: a photo studio instead; `auto`: the studio if
    the MJCF has no lamp."""
    overlay: list[str] = []
    """Drawn on the video; a heatmap may have an end of its colours [m, m/s]: `"height=0.02"`."""
    camera: CameraEntry = msgspec.field(default_factory=CameraEntry)
    """Where the video is seen from, see below."""
    drop: list[DropEntry] = []
    """Bodies held until a time, see below."""
    throw: list[ThrowEntry] = []
    """Bodies thrown at a time, see below."""
    place: list[PlaceEntry] = []
    """Bodies moved at a time, see below."""
    poke: list[PokeEntry] = []
    """Pushes on surfaces, see below."""
    change: list[ChangeEntry] = []
    """Changes of materials, see below."""
    control: list[ControlEntry] = []
    """Controls of actuators, see below."""
    sensor: list[SensorEntry] = []
    """Signals from surfaces, see below."""
    random: RandomEntry | None = None
    """Variation by a seed, see below."""


def parse_scene(table: dict[str, Any], origin: str) -> SceneFile:
    """Check a scene's table against the schema.

    Raises `SceneError` with the place, the value and the expected values.
    """
    title = f"scene file {origin!r}"
    check_keys(table, SceneFile, title)
    _check_values(table, "", title)
    return converted(table, SceneFile, title)


def converted(table: Any, schema: type[Entry], title: str) -> Entry:
    """A table read by a schema.

    If the table does not fit, raises `SceneError` with the title of the table, the key and the
    value.
    """
    try:
        return msgspec.convert(table, schema)
    except msgspec.ValidationError as error:
        message = str(error).replace("`$.", "`")
        choices = _choices_at(schema, message)
        advice = ""
        if choices:
            advice = f"; it must be {', '.join(map(repr, choices[:-1]))} or {choices[-1]!r}"
        raise SceneError(f"{title}: {message}{advice}") from error


def _choices_at(schema: Any, message: str) -> tuple[str, ...]:
    """The words that a field takes; empty if it takes any.

    The path of the field stands at the end of the message, which is msgspec's.
    """
    path = re.search(r" - at `(.*)`$", message)
    kind = schema
    for name in re.findall(r"\w+", path[1] if path else ""):
        table = table_of(kind)
        fields = msgspec.structs.fields(table) if table else ()
        kind = {field.name: field.type for field in fields}.get(name)
    return typing.get_args(kind) if typing.get_origin(kind) is typing.Literal else ()


def _check_values(value: Any, key: str, title: str) -> None:
    """Refuse NaN, infinity, absurdly large numbers and texts with a NUL anywhere.

    `key` is the full key of the value, and `title` that of the table, for messages.
    """
    if isinstance(value, dict):
        for name, inner in value.items():
            _check_values(inner, f"{key}.{name}" if key else name, title)
    elif isinstance(value, list):
        for inner in value:
            _check_values(inner, key, title)
    elif isinstance(value, str) and _INVALID_CHARACTERS.search(value):
        raise SceneError(f"{title}: {key} must be a name without a NUL, got {shown(value)}")
    elif isinstance(value, (int, float)) and not abs(value) <= _MAX_NUMBER:
        raise SceneError(
            f"{title}: {key} must be a number up to {_MAX_NUMBER:g}, got {shown(value)}"
        )


def table_of(kind: Any) -> type[msgspec.Struct] | None:
    """The schema of a field that holds a table or a list of tables; None for other fields."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        return kind
    return next(filter(None, map(table_of, typing.get_args(kind))), None)


def check_keys(table: Any, schema: type[msgspec.Struct], title: str, place: str = "") -> None:
    """Refuse unknown keys before msgspec does, with the list of valid keys.

    Parameters
    ----------
    table : dict
        Other values are left to msgspec.
    schema : type
    title : str
        Title of the whole table, for messages.
    place : str
        Full key of a table within it.

    Raises
    ------
    SceneError
    """
    if not isinstance(table, dict):
        return
    fields = {field.name: field.type for field in msgspec.structs.fields(schema)}
    for key, value in table.items():
        if key not in fields:
            table_name = f" in [{place}]" if place else ""
            raise SceneError(
                f"{title}: unknown key {key!r}{table_name}; keys are {', '.join(fields)}"
            )
        inner = table_of(fields[key])
        inner_place = f"{place}.{key}" if place else key
        if inner is not None:
            if isinstance(value, dict) and typing.get_origin(fields[key]) is list:
                raise SceneError(
                    f"{title}: [{inner_place}] is one table, where there may be several; write "
                    f"[[{inner_place}]]"
                )
            for item in value if isinstance(value, list) else [value]:
                check_keys(item, inner, title, inner_place)


def uniform_material(entry: RippleEntry) -> Material:
    """A target's material before its maps.

    While the thickness of its layer is unknown, so is the range of wavelengths for which the
    material holds.
    """
    material = entry.material.material()
    if entry.inside:
        return dataclasses.replace(material, wavelengths=(0.0, np.inf))
    return material


def apply_maps(ripples: Ripples, entry: RippleEntry) -> None:
    """Give a target the coefficients that vary over it, and hold its still regions.

    Raises `RippleError` if a file cannot be read, or does not suit the target.
    """
    atlas = ripples[entry.geom].atlas
    coefficients = {}
    if entry.inside:
        to_atlas = functools.partial(ripples.to_geom, entry.geom)
        bodies = [moved(inside.body(), to_atlas) for inside in entry.inside]
        thickness = thickness_map(atlas, bodies, entry.thickness_limits)
        coefficients.update(vars(entry.material.material(thickness)))
    for name, texture in entry.material.maps().items():
        coefficients[name] = texture_map(
            atlas, texture.map, texture.low, texture.high, texture.channel
        )
    if coefficients:
        ripples.change_material(entry.geom, **coefficients)
    if entry.still_map is not None:
        ripples.hold(entry.geom, 1.0 - texture_map(atlas, entry.still_map, 0.0, 1.0))
    for disc in entry.still:
        ripples.make_rigid(entry.geom, disc.point, disc.radius)
