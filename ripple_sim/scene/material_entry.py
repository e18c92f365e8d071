"""`[ripple.material]` of a scene file: coefficients as numbers or images, and presets.

The coefficients are the fields of `Material`, and the parameters of a preset those of its
constructor.
"""

from __future__ import annotations

import dataclasses
import inspect
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Material
from ripple_sim.solver.operator.presets import LAWS, PRESETS

# Advice for targets of which only a layer ripples.
_LAYER_ADVICE = (
    "write preset = {name = 'layer', modulus = ...} or another of a layer under [ripple.material]"
)


class MapEntry(msgspec.Struct, forbid_unknown_fields=True):
    """A coefficient from an image in the mesh's own texture coordinates, see `texture_map`."""

    map: str
    """Path of the image, relative to the scene file."""
    low: float = 0.0
    """Value where it is black, in the coefficient's unit."""
    high: float = 1.0
    """Value where it is white."""
    channel: str = "luminance"
    """Part of the image that counts."""


Coefficient = float | str | MapEntry


class PresetEntry(msgspec.Struct, forbid_unknown_fields=True):
    """A preset by name, with its parameters in their units.

    The name is a constructor of `Material`, membrane, layer, jelly, plate, dent, water or suited,
    or that of a real material, see `PRESETS`. The other fields are parameters of these
    constructors; each takes some of them. What is left out of "suited", waves that are to be seen,
    is found from the target and from the bodies that can touch it.
    """

    name: str
    tension: float | None = None
    density: float | None = None
    damping: float | None = None
    modulus: float | None = None
    viscosity: float | None = None
    thickness: float | None = None
    poisson: float | None = None
    yield_height: float | None = None
    stiffness: float | None = None
    speed: float | None = None
    gravity: float | None = None
    short: bool | None = None
    size: float | None = None
    hit: float | tuple[float, float] | None = None
    radius: float | None = None
    amplitude: float | None = None
    crossing: float | None = None
    decay: float | None = None

    def material(self, thickness: NDArray[np.float64] | None = None) -> Material:
        """The preset's material; its layer's thickness may be one at every texel [m], [C, n, n].

        Raises `SceneError` for an unknown preset, a parameter that it does not take, or a missing
        one.
        """
        parameters = given_fields(self, without="name")
        if thickness is not None:
            if _law(self.name) not in ("layer", "jelly"):
                raise SceneError(
                    "[[ripple.inside]] needs a material with a layer, not the preset "
                    f"{self.name!r}; {_LAYER_ADVICE}"
                )
            parameters["thickness"] = thickness
        return preset_material(self.name, parameters)


def _law(name: str) -> str:
    """Constructor of `Material` that makes a preset; raises `SceneError` for an unknown one."""
    if name not in (*LAWS, *PRESETS):
        raise SceneError(f"preset must be one of {', '.join((*LAWS, *PRESETS))}, got {name!r}")
    return PRESETS[name].law if name in PRESETS else name


def preset_material(name: str, values: dict[str, Any]) -> Material:
    """Material of a preset, with values of its parameters.

    Raises `SceneError` for an unknown preset, a parameter that it does not take, or a missing one.
    """
    parameters = inspect.signature(getattr(Material, _law(name))).parameters
    for key in values:
        if key not in parameters:
            raise SceneError(
                f"the preset {name!r} has no parameter {key!r}; its parameters are "
                f"{', '.join(parameters)}"
            )
    for key, parameter in parameters.items():
        is_needed = name not in PRESETS and parameter.default is inspect.Parameter.empty
        if is_needed and key not in values:
            raise SceneError(
                f"the preset {name!r} needs {key}: write {name},{key}=..., or in a scene file "
                f"preset = {{name = {name!r}, {key} = ...}}"
            )
    return Material.preset(name, **values)


class MaterialEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """`[ripple.material]`: the wave equation's coefficients, as in `Material`.

    Each is a number, the path of an image, or a table {map = ..., low = ..., high = ...}.
    Coefficients that are left out are those of the preset, or without one those of `Material()`.
    `deep`, `tightening` and `poisson` are the same everywhere: no map gives them.
    """

    speed: Coefficient | None = None
    damping: Coefficient | None = None
    stiffness: Coefficient | None = None
    viscosity: Coefficient | None = None
    density: Coefficient | None = None
    bending: Coefficient | None = None
    yield_height: Coefficient | None = None
    deep: float | None = None
    tightening: float | None = None
    poisson: float | None = None
    preset: str | PresetEntry | None = None
    """Gives the coefficients that are left out; by its name, or as a table with its parameters."""

    def material(self, thickness: NDArray[np.float64] | None = None) -> Material:
        """The solver's material; where a coefficient is a map, with its value for white.

        Parameters
        ----------
        thickness : [C, n, n], optional
            Of the layer at every texel [m].

        Raises
        ------
        SceneError
            For an invalid preset.
        SolverError
            For an invalid coefficient.
        """
        preset = PresetEntry(name=self.preset) if isinstance(self.preset, str) else self.preset
        if preset is None and thickness is not None:
            raise SceneError(f"[[ripple.inside]] needs a layer; {_LAYER_ADVICE}")
        base = Material() if preset is None else preset.material(thickness)
        coefficients = {name: entry.high for name, entry in self.maps().items()}
        for name, value in given_fields(self, without="preset").items():
            if isinstance(value, int | float):
                coefficients[name] = value
        return dataclasses.replace(base, **coefficients)

    def maps(self) -> dict[str, MapEntry]:
        """The coefficients that are maps."""
        maps = {}
        for name, value in given_fields(self, without="preset").items():
            if isinstance(value, str):
                maps[name] = MapEntry(value)
            elif isinstance(value, MapEntry):
                maps[name] = value
        return maps

    def located(self, folder: Path) -> MaterialEntry:
        """The same material, with the paths of its images relative to a folder."""
        maps = {}
        for name, entry in self.maps().items():
            maps[name] = msgspec.structs.replace(entry, map=str(folder / entry.map))
        return msgspec.structs.replace(self, **maps)


class MaterialChange(msgspec.Struct, forbid_unknown_fields=True):
    """`[change.material]`: the coefficients that change; the others stay as they are."""

    speed: float | None = None
    damping: float | None = None
    stiffness: float | None = None
    viscosity: float | None = None
    density: float | None = None
    bending: float | None = None
    yield_height: float | None = None
    deep: float | None = None
    tightening: float | None = None
    poisson: float | None = None


# Names of all coefficients: those of the class above.
COEFFICIENTS = MaterialChange.__struct_fields__


def given_fields(entry: msgspec.Struct, without: str = "") -> dict[str, Any]:
    """The fields of a struct that are not None, but for the one named `without`."""
    # `asdict` would turn maps into dictionaries
    fields = {}
    for name in entry.__struct_fields__:
        value = getattr(entry, name)
        if name != without and value is not None:
            fields[name] = value
    return fields
