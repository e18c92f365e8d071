"""The TOML file of a scene: its tables, read strictly."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown

from .camera import CameraEntry
from .events import ChangeEntry, ControlEntry, PokeEntry
from .height_entry import HeightEntry
from .material_entry import MapEntry, MaterialChange, MaterialEntry, PresetEntry
from .motion import DropEntry, PlaceEntry, ThrowEntry, Vector
from .randomize import RandomEntry
from .target_maps import InsideEntry

Color = tuple[float, float, float]


class StillEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[ripple.still]]`: a disc of the surface without waves."""

    point: Vector
    """In the frame of the geom's body [m]; the nearest point of the surface is taken."""
    radius: float
    """Along the surface [m]."""


class RippleEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[ripple]]`: one target, its material and its look."""

    geom: str
    """Name of the geom, or of its body and its index there: "torso/0"."""
    resolution: int | None = None
    """Texels along the edge of a chart; by default chosen by the model, see `suited_resolution`."""
    layout: str = "auto"
    """How the surface gets its charts, see `build_atlas`."""
    rim: str = "free"
    """Rims of an open surface: waves come back upright from a free one, inverted from a fixed one."""
    look: str = "rubber"
    """What the surface looks made of; `model` as the MJCF's material says."""
    color: Color | None = None
    """sRGB, 0 to 1; by default the texture or colour that the MJCF gives the geom, or else the look's."""
    material: MaterialEntry = msgspec.field(default_factory=MaterialEntry)
    """The wave equation's coefficients, see below."""
    still: list[StillEntry] = []
    """Discs without waves, see below."""
    still_map: str | None = None
    """Path of an image in the mesh's own texture coordinates: no waves where it is black."""
    inside: list[InsideEntry] = []
    """What lies under a layer, see below."""
    height: HeightEntry | None = None
    """The shape of the surface at the beginning, see below; by default it is flat."""
    thickness_limits: tuple[float, float] = (0.0, math.inf)
    """Least and greatest thickness of a layer over what is inside [m]: beyond them it counts as these."""
    contacts: list[str] | None = None
    """Geoms that collide for a geom that is only visible; by default those of its body."""
    high_pass: bool = False
    """Whether a flex keeps to itself the coarse motion that contacts give it; its waves get the fine rest."""
    limit: bool = True
    """Bend heights that are too large for the object where they are drawn, and warn of them."""
    warn: bool = True
    """Whether to warn of them."""

    def located(self, folder: Path) -> RippleEntry:
        """The same with its files' paths made relative to a folder."""
        return msgspec.structs.replace(
            self,
            material=self.material.located(folder),
            still_map=None if self.still_map is None else str(folder / self.still_map),
            inside=[entry.located(folder) for entry in self.inside],
            height=None if self.height is None else self.height.located(folder),
        )


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
    """`model`: the MJCF's lamps and skybox; `studio`: a photo studio instead; `auto`: the studio if the MJCF has no
    lamp."""
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
    random: RandomEntry | None = None
    """Variation by a seed, see below."""


def parse_scene(table: dict[str, Any], origin: str) -> SceneFile:
    """Check a scene's table against the schema.

    Raises
    ------
    SceneError
        Naming the place, the value and what is valid.
    """
    _check_keys(table, SceneFile, "", origin)
    _check_values(table, "", origin)
    try:
        return msgspec.convert(table, SceneFile)
    except msgspec.ValidationError as error:
        raise SceneError(f"scene file {origin!r}: {str(error).replace('`$.', '`')}") from error


# Metres, seconds, newtons, degrees: no sensible scene has larger numbers, and their squares do not overflow.
_LARGEST = 1e12


def _check_values(value: Any, place: str, origin: str) -> None:
    """Refuse NaN, infinity, absurdly large numbers and texts with a NUL anywhere."""
    if isinstance(value, dict):
        for key, inner in value.items():
            _check_values(inner, f"{place}.{key}" if place else key, origin)
    elif isinstance(value, list):
        for inner in value:
            _check_values(inner, place, origin)
    elif isinstance(value, str) and ("\0" in value or not _is_unicode(value)):
        raise SceneError(f"scene file {origin!r}: {place} is {shown(value)}; valid are names without a NUL")
    elif isinstance(value, (int, float)) and not abs(value) <= _LARGEST:
        raise SceneError(f"scene file {origin!r}: {place} is {shown(value)}; valid are numbers up to {_LARGEST:g}")


def _is_unicode(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:  # half of a pair of surrogates
        return False
    return True


_TABLES: dict[str, type[msgspec.Struct]] = {
    "ripple": RippleEntry,
    "ripple.material": MaterialEntry,
    **{f"ripple.material.{field.name}": MapEntry for field in msgspec.structs.fields(MaterialEntry)},
    "ripple.material.preset": PresetEntry,
    "ripple.still": StillEntry,
    "ripple.inside": InsideEntry,
    "ripple.height": HeightEntry,
    "camera": CameraEntry,
    "drop": DropEntry,
    "throw": ThrowEntry,
    "place": PlaceEntry,
    "poke": PokeEntry,
    "change": ChangeEntry,
    "change.material": MaterialChange,
    "control": ControlEntry,
    "random": RandomEntry,
}


def _check_keys(table: Any, schema: type[msgspec.Struct], place: str, origin: str) -> None:
    """Refuse unknown keys before msgspec does, with the list of valid ones."""
    if not isinstance(table, dict):
        return
    fields = {field.name: field.type for field in msgspec.structs.fields(schema)}
    for key, value in table.items():
        if key not in fields:
            where = f" in [{place}]" if place else ""
            raise SceneError(f"scene file {origin!r}: unknown key {key!r}{where}; valid are {', '.join(fields)}")
        inner_place = f"{place}.{key}" if place else key
        inner = _TABLES.get(inner_place)
        if inner is not None:
            for item in value if isinstance(value, list) else [value]:
                _check_keys(item, inner, inner_place, origin)
