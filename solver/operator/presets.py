"""Real materials by name: a law of `Material`, its parameters, where they come from, and where they hold."""

from __future__ import annotations

import dataclasses

from ripple_sim.solver.checked import shown
from ripple_sim.solver.errors import SolverError

_GELATINE = (
    "Nguyen et al. 2014, Ultrasound in Medicine and Biology 40, 168 (shear wave elastography, Voigt model; "
    "the viscosity is that of 3 % gelatine)"
)
_LAYER = "waves of 0.8 to 4.8 times the thickness, lower than a tenth of it"


@dataclasses.dataclass(frozen=True)
class Preset:
    """A real material.

    Attributes
    ----------
    law : str
        Name of the constructor of `Material`.
    parameters : dict
        Of the constructor, in its units. What can be chosen, as the thickness, has a value that is usual.
    source : str
        Where the numbers come from.
    valid : str
        Where they hold.
    """

    law: str
    parameters: dict[str, float]
    source: str
    valid: str


def _gelatine(modulus: float) -> Preset:
    layer = {"modulus": modulus, "viscosity": 0.6, "density": 1000.0, "thickness": 0.05}
    return Preset("layer", layer, _GELATINE, _LAYER)


PRESETS: dict[str, Preset] = {
    "gelatine-3": _gelatine(2010.0),
    "gelatine-5": _gelatine(4180.0),
    "gelatine-7": _gelatine(10240.0),
    "rubber-layer": Preset(
        "layer",
        {"modulus": 0.45e6, "viscosity": 20.0, "density": 1000.0, "thickness": 0.05},
        "Lindley 1974, Engineering Design with Natural Rubber (40 IRHD; the viscosity is chosen)",
        _LAYER,
    ),
    "rubber-sheet": Preset(
        "plate",
        {"modulus": 1.5e6, "thickness": 0.002, "density": 1000.0, "poisson": 0.5, "damping": 2.0},
        "Lindley 1974, Engineering Design with Natural Rubber (40 IRHD; the damping is chosen)",
        "waves longer than ten times the thickness; no tension",
    ),
    "drum-skin": Preset(
        "membrane",
        {"tension": 3990.0, "density": 0.262, "damping": 4.0},
        "Christian et al. 1984, Journal of the Acoustical Society of America 76, 1336 (Mylar head of a kettledrum; "
        "the damping is chosen)",
        "without the air, which slows the lowest modes by up to a third",
    ),
    "steel-plate": Preset(
        "plate",
        {"modulus": 210e9, "thickness": 0.002, "density": 7850.0, "poisson": 0.3, "damping": 2.0},
        "EN 1993-1-1 and EN 1991-1-1 (the damping is chosen)",
        "waves longer than ten times the thickness",
    ),
    "soap-film": Preset(
        "membrane",
        {"tension": 0.05, "density": 0.01, "damping": 2.0},
        "Couder, Chomaz and Rabaud 1989, Physica D 37, 384 (two surfaces of 25 mN/m, 10 micrometres of water; the "
        "damping is chosen)",
        "without the air, which weighs more than the film for waves longer than some centimetres",
    ),
}


def preset_named(name: str) -> Preset:
    """The preset of a name.

    Raises
    ------
    SolverError
        If there is none.
    """
    if name not in PRESETS:
        raise SolverError(f"the preset {shown(name)} does not exist; valid are {', '.join(PRESETS)}")
    return PRESETS[name]
