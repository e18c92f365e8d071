"""`Choices`: the materials and looks that the user has chosen in the viewer, by target."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import msgspec
import numpy as np

from ripple_sim.coupling.ripples import Ripples
from ripple_sim.render.visuals.visual import find_look
from ripple_sim.scene.material_entry import COEFFICIENTS, MaterialEntry
from ripple_sim.scene.scene_file import RippleEntry
from ripple_sim.solver import Material

# Coefficients that sliders multiply, and the greatest factor.
_FACTORS = ("speed", "damping", "stiffness")
_MAX_FACTOR = 8.0


class Choices:
    """Real materials and looks in place of a scene's own ones, and factors of the sliders.

    Parameters
    ----------
    ripples : Ripples
        With the scene's own materials, to which an empty choice returns.
    """

    def __init__(self, ripples: Ripples) -> None:
        self._ripples = ripples
        self._own = {name: ripples[name].material for name in ripples}
        self._presets = dict.fromkeys(ripples, "")
        self._looks = dict.fromkeys(ripples, "")
        self._factors = dict.fromkeys(_FACTORS, 1.0)

    def choose_preset(self, targets: Iterable[str], preset: str) -> None:
        """Give targets a real material, or their own again for an empty name.

        Raises `SolverError` for an unknown name.
        """
        if preset:
            Material.preset(preset)
        for target in targets:
            self._presets[target] = preset
        self.apply()

    def choose_look(self, targets: Iterable[str], look: str) -> None:
        """Give targets a look, or their own again for an empty name.

        Raises `RippleError` for an unknown name.
        """
        if look:
            find_look(look)
        for target in targets:
            self._looks[target] = look

    def by_target(self) -> list[dict[str, str]]:
        """Names of the preset and the look of each target, empty for its own."""
        return [
            {"preset": self._presets[name], "look": self._looks[name]} for name in self._presets
        ]

    def look(self, target: str) -> str:
        """Name of the look that is chosen for a target, or an empty name."""
        return self._looks[target]

    def choose_factors(self, factors: Mapping[str, float]) -> None:
        """Multiply coefficients of all targets.

        Raises `ValueError` for a factor that is too large or negative, or of another coefficient.
        """
        for name, factor in factors.items():
            if name not in _FACTORS:
                raise ValueError(f"a factor must be of {', '.join(_FACTORS)}, got {name[:40]!r}")
            if not 0 <= factor <= _MAX_FACTOR:
                raise ValueError(f"a factor must be from 0 to {_MAX_FACTOR:g}, got {factor!r}")
        self._factors = {name: factors.get(name, 1.0) for name in _FACTORS}
        self.apply()

    def apply(self) -> None:
        """Give the targets the materials that are chosen; the waves stay as they are."""
        for target, own in self._own.items():
            preset = self._presets[target]
            material = Material.preset(preset) if preset else own
            coefficients = dict(vars(material))
            for name, factor in self._factors.items():
                if factor != 1.0:
                    coefficients[name] = factor * np.asarray(coefficients[name])
            self._ripples.change_material(target, **coefficients)

    @property
    def is_empty(self) -> bool:
        """Whether all materials are the scene's own."""
        return not any(self._presets.values()) and not self._is_scaled

    @property
    def _is_scaled(self) -> bool:
        return any(factor != 1.0 for factor in self._factors.values())

    def chosen(self, entry: RippleEntry) -> RippleEntry:
        """The entry of a target for a scene file with the material and look that it has now.

        A material that the model chose is written as numbers, since another model chooses another.

        Raises `ValueError` if factors are chosen for a material that varies over the surface.
        """
        look = self._looks[entry.geom] or entry.look
        entry = msgspec.structs.replace(entry, look=look)
        preset = self._presets[entry.geom]
        if preset:
            material = MaterialEntry(preset=preset)
            limits = RippleEntry(entry.geom).thickness_limits
            entry = msgspec.structs.replace(
                entry, material=material, inside=[], thickness_limits=limits
            )
        is_by_model = entry.material.density is None and entry.material.preset is None
        if not (self._is_scaled or is_by_model):
            return entry
        numbers = _numbers(self._ripples[entry.geom].material)
        if numbers is not None:
            return msgspec.structs.replace(entry, material=MaterialEntry(**numbers))
        if self._is_scaled:
            raise ValueError(
                f"the material of {entry.geom!r} varies over the surface, and a scene file cannot "
                "multiply it; bring the sliders back to the middle (As in the scene)"
            )
        return entry


def _numbers(material: Material) -> dict[str, Any] | None:
    """The coefficients of a uniform material that differ from a plain one; None of any other."""
    plain = Material()
    coefficients = {name: np.asarray(getattr(material, name)) for name in COEFFICIENTS}
    if any(value.size > 1 for value in coefficients.values()):
        return None
    return {
        name: float(value.item())
        for name, value in coefficients.items()
        if name == "density" or value.item() != getattr(plain, name)
    }
