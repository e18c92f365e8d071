"""Coefficients of materials: of real ones, by name, and those that suit an object's size and what hits it.

How far a surface gives way, and what stiffness or density keeps it from giving way further: a load
F that is spread like a Gaussian of standard deviation s presses a membrane with a restoring
stiffness in by

    h = F / (4 pi sigma c^2) exp(z) E1(z),    z = s^2 k / (2 c^2),

the integral of exp(-q^2 s^2 / 2) / (c^2 q^2 + k) over all wave numbers q. For the exponential
integral this takes ln(1 + 1/z), which is an upper bound and can be inverted (Abramowitz and Stegun
1964, 5.1.20).
"""

from __future__ import annotations

import dataclasses
import math

from ..errors import SolverError
from .coefficients import require_positive

_GELATINE = (
    "Nguyen et al. 2014, Ultrasound in Medicine and Biology 40, 168 (shear wave elastography, "
    "Voigt model; "
    "the viscosity is that of 3 % gelatine)"
)
_SILICONE = (
    "Ba et al. 2017, Scientific Reports 7, 40106 (soft silicone rubber: its shear modulus "
    "and density"
)
_LAYER = "waves of 0.8 to 4.8 times the thickness, lower than a tenth of it"

# Standard deviation of a footprint (1 - (d/r)^2)^3 along an axis, over its radius r.
SPREAD = 10**-0.5

# Size over the length to which a dent narrows, c / sqrt(k).
NARROW = 16.0

# Impulse of a hit over mass times speed: it bounces back with half its speed.
BOUNCE = 1.5
_RADIUS = 0.05  # footprint over size

# smaller ones count as of this size: texels resolve none that are, and their rings would not be
# seen
FOOTPRINT = 0.025
_VISCOSITY = 1e-3  # over speed times size
_GRAVITY = 9.81


@dataclasses.dataclass(frozen=True)
class Preset:
    """A real material.

    Attributes
    ----------
    law : str
        Name of the constructor of `Material`.
    parameters : dict
        Of the constructor, in its units. What can be chosen, as the thickness, has a value that is
        usual.
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
        "elastography of relaxed "
        "thighs along the fibres: a springpot of 2.68 kPa, exponent 0.253 and 1 Pa s, here at 40 "
        "Hz; "
        "the density is chosen)",
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
        "of a kettledrum; "
        "the damping is chosen)",
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
        "10 micrometres of "
        "water and the damping are chosen)",
        "without the air, which weighs more than the film for waves longer than some centimetres",
        checked=True,
    ),
    "clean-water": Preset(
        "water",
        {"density": 998.2, "tension": 0.0728, "gravity": 9.81, "viscosity": 1.003e-6},
        "Venard and Street 1975, Elementary Fluid Mechanics (water at 20 degrees)",
        (
            "waves lower than a tenth of their length and shorter than twice the depth; an oily "
            "surface damps more"
        ),
        checked=True,
    ),
}


def stiffness_under(
    force: float, depth: float, *, radius: float, density: float, speed: float
) -> float:
    """Stiffness with which a resting load sinks by a depth at most [1/s^2].

    Parameters
    ----------
    force : float
        [N].
    depth, radius : float
        [m], the latter of the footprint.
    density, speed : float
        Of the material [kg/m^2], [m/s].
    """
    if not force > 0:
        return 0.0
    ratio = 4 * math.pi * density * speed**2 * depth / force
    spread = SPREAD * radius
    if ratio < 1e-9:  # tension bears nothing
        return force / (2 * math.pi * density * spread**2 * depth)
    return 2 * speed**2 / spread**2 / math.expm1(ratio) if ratio < 100 else 0.0


def density_under(
    force: float, depth: float, *, radius: float, speed: float, stiffness: float
) -> float:
    """Density with which a resting load sinks by a depth at most [kg/m^2]; infinite without speed and stiffness.

    Arguments are as for `stiffness_under`; `stiffness` is the material's [1/s^2].
    """
    if not force > 0:
        return 0.0
    if not stiffness > 0:
        return math.inf
    return depth_under(force, radius=radius, density=1.0, speed=speed, stiffness=stiffness) / depth


def depth_under(
    force: float, *, radius: float, density: float, speed: float, stiffness: float
) -> float:
    """How deep a resting load sinks, at most [m]; with a stiffness greater than 0.

    Arguments are as above.
    """
    ratio = 2 * speed**2 / ((SPREAD * radius) ** 2 * stiffness)
    # of what the stiffness alone would let it sink
    share = math.log1p(ratio) / ratio if ratio > 0 else 1.0
    return share * force / (2 * math.pi * (SPREAD * radius) ** 2 * stiffness * density)


def density_after(
    impulse: float, depth: float, *, duration: float, radius: float, speed: float, stiffness: float
) -> float:
    """Density with which a hit [N s] dents the surface by about a depth at most [kg/m^2].

    The hit counts as a load impulse / T for a time T, its duration or, if that is longer, the time
    that a wave takes across the footprint's standard deviation. In this time the surface's own
    inertia holds it back as a stiffness of 1 / T^2 would.
    """
    time = max(duration, SPREAD * radius / speed if speed > 0 else 0.0)
    return density_under(
        impulse / time, depth, radius=radius, speed=speed, stiffness=stiffness + 1 / time**2
    )


def density_for(impulse: float, depth: float, *, radius: float, speed: float) -> float:
    """Density with which a short hit dents a surface without stiffness by a depth [kg/m^2].

    The dent of a Gaussian footprint is deepest after 1.31 s / c, with s its standard deviation:
    there it is 0.765 J / (2 pi sigma c s), where 0.765 is sqrt(2) times the maximum of Dawson's
    integral.
    """
    return 0.765 * impulse / (2 * math.pi * speed * SPREAD * radius * depth)


def suited_coefficients(
    size: float,
    hit: float | tuple[float, float],
    radius: float | None,
    amplitude: float,
    crossing: float,
    decay: float,
) -> dict[str, float]:
    """Coefficients by their names; see `Material.suited`."""
    require_positive(size=(size, "m"))
    radius = _RADIUS * size if radius is None else radius
    if isinstance(hit, tuple | list):
        if len(hit) != 2:
            raise SolverError(
                f"hit is {hit!r}; valid is an impulse [N s], or a mass [kg] and a speed [m/s]"
            )
        mass, velocity = hit
        require_positive(**{"mass of the hit": (mass, "kg"), "speed of the hit": (velocity, "m/s")})
        impulse = BOUNCE * mass * velocity
    else:
        require_positive(hit=(hit, "N s"))
        # that of the body is not known
        impulse = hit
        mass = 0.0
    require_positive(radius=(radius, "m"), amplitude=(amplitude, "of the size"))
    require_positive(crossing=(crossing, "s"), decay=(decay, "s"))
    speed = size / crossing
    depth = amplitude * size
    radius = max(radius, FOOTPRINT * size)
    density = density_for(impulse, depth, radius=radius, speed=speed)
    resting = stiffness_under(
        _GRAVITY * mass, depth / 2, radius=radius, density=density, speed=speed
    )
    return {
        "speed": speed,
        "damping": damping_for(decay),
        "stiffness": max(narrow_stiffness(size, speed), resting),
        "viscosity": _VISCOSITY * speed * size,
        "density": density,
    }


def narrow_stiffness(size: float, speed: float) -> float:
    """Stiffness that keeps dents narrow beside the object [1/s^2]."""
    return (NARROW * speed / size) ** 2


def damping_for(decay: float) -> float:
    """Damping with which waves fall to a tenth in a time [s], in 1/s."""
    return 2 * math.log(10) / decay
