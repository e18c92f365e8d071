"""`[ripple.material]` of a scene file: coefficients as numbers or pictures, alone or on top of a preset."""

from __future__ import annotations

import dataclasses
import inspect
from pathlib import Path

import msgspec

from ripple_sim.errors import SceneError
from ripple_sim.solver import Material

PRESETS = ("membrane", "jelly", "plate", "dent")


class MapEntry(msgspec.Struct, forbid_unknown_fields=True):
    """A coefficient from a picture in the mesh's own texture coordinates, see `texture_map`.

    `map` is the picture's path, relative to the scene file; black stands for `low`, white for `high`.
    """

    map: str
    low: float = 0.0
    high: float = 1.0
    channel: str = "luminance"


class PresetEntry(msgspec.Struct, forbid_unknown_fields=True):
    """A preset by name, with parameters of its own: those of `Material.membrane`, `jelly`, `plate` or `dent`.

    Units: tension [N/m]; modulus [Pa]; thickness [m]; viscosity [Pa s]; density [kg/m^2] of a membrane or a dent,
    [kg/m^3] of jelly or a plate; damping [1/s]; stiffness [1/s^2]; speed [m/s]; yield_height [m].
    """

    name: str
    tension: float | None = None
    modulus: float | None = None
    thickness: float | None = None
    viscosity: float | None = None
    density: float | None = None
    poisson: float | None = None
    damping: float | None = None
    stiffness: float | None = None
    speed: float | None = None
    yield_height: float | None = None

    def material(self) -> Material:
        """The preset's material.

        Raises
        ------
        SceneError
            For an unknown preset, a parameter that it does not take, or one that it needs.
        """
        if self.name not in PRESETS:
            raise SceneError(f"ripple.material.preset {self.name!r} does not exist; valid are {', '.join(PRESETS)}")
        preset = getattr(Material, self.name)
        parameters = inspect.signature(preset).parameters
        given = {
            key: value for key, value in msgspec.structs.asdict(self).items() if value is not None and key != "name"
        }
        for key in given:
            if key not in parameters:
                raise SceneError(
                    f"the preset {self.name!r} has no parameter {key!r}; valid are {', '.join(parameters)}"
                )
        for key, parameter in parameters.items():
            if parameter.default is inspect.Parameter.empty and key not in given:
                raise SceneError(
                    f"the preset {self.name!r} needs {key}: write preset = {{name = {self.name!r}, {key} = ...}}"
                )
        return preset(**given)


Coefficient = float | str | MapEntry


class MaterialEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[ripple.material]`: the wave equation's coefficients, see `Material`.

    Units: speed [m/s], damping [1/s], stiffness [1/s^2], viscosity [m^2/s], density [kg/m^2], bending [m^4/s^2],
    yield_height [m]. Each is a number, the path of a picture, or a table {map = ..., low = ..., high = ...}. A preset,
    by its name or as a table {name = ..., its parameters}, gives those that are left out; without one they are those of
    `Material()`.
    """

    speed: Coefficient | None = None
    damping: Coefficient | None = None
    stiffness: Coefficient | None = None
    viscosity: Coefficient | None = None
    density: Coefficient | None = None
    bending: Coefficient | None = None
    yield_height: Coefficient | None = None
    preset: str | PresetEntry | None = None

    def material(self) -> Material:
        """The solver's material; where a coefficient is a map, with its value for white.

        Raises
        ------
        SceneError
            For an invalid preset.
        SolverError
            For an invalid coefficient.
        """
        preset = PresetEntry(self.preset) if isinstance(self.preset, str) else self.preset
        numbers = {name: value for name, value in self._coefficients().items() if isinstance(value, int | float)}
        white = {name: entry.high for name, entry in self.maps().items()}
        return dataclasses.replace(preset.material() if preset is not None else Material(), **numbers, **white)

    def maps(self) -> dict[str, MapEntry]:
        """The coefficients that are maps."""
        return {
            name: value if isinstance(value, MapEntry) else MapEntry(value)
            for name, value in self._coefficients().items()
            if isinstance(value, str | MapEntry)
        }

    def located(self, folder: Path) -> MaterialEntry:
        """The same with the pictures' paths made relative to a folder."""
        return msgspec.structs.replace(
            self,
            **{
                name: msgspec.structs.replace(entry, map=str(folder / entry.map)) for name, entry in self.maps().items()
            },
        )

    def _coefficients(self) -> dict[str, Coefficient]:
        """The coefficients that were given."""
        # not `asdict`, which would not tell the maps from other values
        given = {name: getattr(self, name) for name in self.__struct_fields__ if name != "preset"}
        return {name: value for name, value in given.items() if value is not None}
