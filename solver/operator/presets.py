"""Presets: coefficients of real materials, by name, with their sources."""

from __future__ import annotations

import dataclasses

# Constructors of `Material` that are presets by their own names.
LAWS = ("membrane", "layer", "jelly", "plate", "dent", "water", "suited")

# Source of the gelatines.
_GELATINE = (
    "Nguyen et al. 2014, Ultrasound in Medicine and Biology 40, 168 (shear wave elastography, "
    "Voigt model; the viscosity is that of 3 % gelatine)"
)


# Source of the rubbers; each of them closes the bracket.
_SILICONE = (
    "Ba et al. 2017, Scientific Reports 7, 40106 (soft silicone rubber: its shear modulus "
    "and density"
)


# Where the numbers of a layer hold.
_LAYER = "waves of 0.8 to 4.8 times the thickness, lower than a tenth of it"


@dataclasses.dataclass(frozen=True)
class Preset:
    """A real material.

    Attributes
    ----------
    law : str
        Name of the constructor of `Material`.
    parameters : dict
        Arguments of the constructor, in its units. Those that can be chosen, such as the thickness,
        have a usual value.
    source : str
        Where the numbers come from.
    valid : str
        Where they hold.
    checked : bool
        Whether the numbers were compared with the source, or with its abstract, for this list.
    """

    law: str
    parameters: dict[str, float]
    source: str
    valid: str
    checked: bool = False


def _gelatine(modulus: float) -> Preset:
    """A gelatine with a shear modulus [Pa]."""
    layer = {"modulus": modulus, "viscosity": 0.6, "density": 1000.0, "thickness": 0.05}
    return Preset("layer", layer, _GELATINE, _LAYER, checked=True)


PRESETS: dict[str, Preset] = {
    "gelatine-3": _gelatine(2010.0),
    "gelatine-5": _gelatine(4180.0),
    "gelatine-7": _gelatine(10240.0),
    "skin-over-muscle": Preset(
        "layer",
        {"modulus": 1360.0, "viscosity": 2.3, "density": 1060.0, "thickness": 0.03},
        "Klatt et al. 2010, Physics in Medicine and Biology 55, 6445 (magnetic resonance "
        "elastography of relaxed thighs along the fibres: a springpot of 2.68 kPa, exponent 0.253 "
        "and 1 Pa s, here at 40 Hz; the density is chosen)",
        _LAYER + "; without the skin's own stiffness, and alike along and across the fibres",
        checked=True,
    ),
    "agarose": Preset(
        "layer",
        {"modulus": 3000.0, "viscosity": 0.5, "density": 1000.0, "thickness": 0.05},
        "order of magnitude of gels of 0.5 to 1 %, Normand et al. 2000, Biomacromolecules 1, 730",
        _LAYER + "; gels of one concentration differ by several times, by how they were cooled",
    ),
    "ecoflex-00-30": Preset(
        "layer",
        {"modulus": 36000.0, "viscosity": 18.0, "density": 1070.0, "thickness": 0.05},
        "Lanoy et al. 2020, PNAS 117, 30186 (26 kPa (1 + (i omega 260 us)^0.33), here at 50 Hz)",
        _LAYER + "; stiffer at higher frequencies",
    ),
    "rubber-layer": Preset(
        "layer",
        {"modulus": 0.3e6, "viscosity": 20.0, "density": 1040.0, "thickness": 0.05},
        f"{_SILICONE}; the viscosity is chosen)",
        _LAYER,
        checked=True,
    ),
    "rubber-sheet": Preset(
        "plate",
        {"modulus": 0.9e6, "thickness": 0.002, "density": 1040.0, "poisson": 0.5, "damping": 2.0},
        f"{_SILICONE}, here three times the former; the damping is chosen)",
        "waves longer than ten times the thickness; no tension",
        checked=True,
    ),
    "drum-skin": Preset(
        "membrane",
        {"tension": 3990.0, "density": 0.262, "damping": 4.0},
        "Christian et al. 1984, Journal of the Acoustical Society of America 76, 1336 (Mylar head "
        "of a kettledrum; the damping is chosen)",
        "without the air, which slows the lowest modes by up to a third",
    ),
    "steel-plate": Preset(
        "plate",
        {"modulus": 210e9, "thickness": 0.002, "density": 7850.0, "poisson": 0.3, "damping": 2.0},
        "EN 1993-1-1 and EN 1991-1-1 (the damping is chosen)",
        "waves longer than ten times the thickness",
        checked=True,
    ),
    "soap-film": Preset(
        "membrane",
        {"tension": 0.06, "density": 0.01, "damping": 2.0},
        "Sane, Mandre and Kim 2018, Journal of Fluid Mechanics 841, R2 (two surfaces of 30 mN/m; "
        "10 micrometres of water and the damping are chosen)",
        "without the air, which weighs more than the film for waves longer than some centimetres",
        checked=True,
    ),
    "clean-water": Preset(
        "water",
        {"density": 998.2, "tension": 0.0728, "gravity": 9.81, "viscosity": 1.003e-6},
        "Venard and Street 1975, Elementary Fluid Mechanics (water at 20 degrees)",
        "waves lower than a tenth of their length and shorter than twice the depth; an oily "
        "surface damps more",
        checked=True,
    ),
}
