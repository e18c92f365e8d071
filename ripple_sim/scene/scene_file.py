"""The TOML file of a scene: its tables, read strictly."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from ripple_sim.errors import SceneError
from ripple_sim.solver.checked import shown

from .camera import CameraEntry
from .events import ChangeEntry, ControlEntry, PokeEntry
from .material_entry import MapEntry, MaterialChange, MaterialEntry, PresetEntry
from .motion import DropEntry, PlaceEntry, ThrowEntry, Vector
from .randomize import RandomEntry

Color = tuple[float, float, float]


class StillEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[ripple.still]]`: a disc of the surface without waves, around a point [m] in the frame of the geom's body."""

    point: Vector
    radius: float


class RippleEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[ripple]]`: one target, its material and its look.

    `resolution` is chosen by the model where it is left out, see `suited_resolution`. `layout` is that of the atlas,
    see `build_atlas`; the `rim` of an open surface is "free" or "fixed".
    `color` (sRGB, 0 to 1) replaces the texture or colour that the MJCF gives the geom; without either it is the look's.
    `still_map` is the path of an image in the mesh's own texture coordinates: there are no waves where it is black.
    `contacts` names the geoms that collide for a geom that is only visible; by default those of its body.
    `limit` bends heights that are too large for the object where they are drawn, see `DisplacementLimit`, and warns of
    them; False: neither. `warn` = False: limited without a warning.
    """

    geom: str
    resolution: int | None = None
    layout: str = "auto"
    rim: str = "free"
    look: str = "rubber"
    color: Color | None = None
    material: MaterialEntry = msgspec.field(default_factory=MaterialEntry)
    still: list[StillEntry] = []
    still_map: str | None = None
    contacts: list[str] | None = None
    limit: bool = True
    warn: bool = True

    def located(self, folder: Path) -> RippleEntry:
        """The same with the images' paths made relative to a folder."""
        still_map = None if self.still_map is None else str(folder / self.still_map)
        return msgspec.structs.replace(self, material=self.material.located(folder), still_map=still_map)


class SceneFile(msgspec.Struct, forbid_unknown_fields=True):
    """The whole TOML file.

    `overlay` names the overlays: "height" or "velocity" as a heatmap (with a fixed end of the colours in m or m/s as in
    "height=0.02"), "contacts", "grid", "time", "energy". `lighting` is "model" for the MJCF's lamps and skybox,
    "studio" for a photo studio instead, or "auto": the studio if the MJCF has no lamp.
    """

    model: str
    ripple: list[RippleEntry]
    duration: float = 5.0
    two_way: bool = False
    lighting: str = "auto"
    overlay: list[str] = []
    camera: CameraEntry = msgspec.field(default_factory=CameraEntry)
    drop: list[DropEntry] = []
    throw: list[ThrowEntry] = []
    place: list[PlaceEntry] = []
    poke: list[PokeEntry] = []
    change: list[ChangeEntry] = []
    control: list[ControlEntry] = []
    random: RandomEntry | None = None


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
    elif isinstance(value, str) and "\0" in value:
        raise SceneError(f"scene file {origin!r}: {place} is {shown(value)}; valid are names without a NUL")
    elif isinstance(value, (int, float)) and not abs(value) <= _LARGEST:
        raise SceneError(f"scene file {origin!r}: {place} is {shown(value)}; valid are numbers up to {_LARGEST:g}")


_TABLES: dict[str, type[msgspec.Struct]] = {
    "ripple": RippleEntry,
    "ripple.material": MaterialEntry,
    **{f"ripple.material.{field.name}": MapEntry for field in msgspec.structs.fields(MaterialEntry)},
    "ripple.material.preset": PresetEntry,
    "ripple.still": StillEntry,
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
