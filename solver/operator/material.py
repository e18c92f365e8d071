"""Materials: the coefficients of the wave equation, from laws, from how they look, and as presets.

Besides: the theory of plane waves on a flat surface of a uniform material, and a warning where an
atlas has no room for the waves for which a material's coefficients hold.
"""

from __future__ import annotations

import dataclasses
import inspect
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import POSITIVE, SolverError, is_finite, shown, warn_caller
from ..texels.atlas import Atlas
from .coefficients import LIMITS, check_mask, check_numbers, check_wavelengths, require_positive
from .presets import LAWS, PRESETS
from .suited_law import suited_coefficients

# A layer has omega^2 = STIFF G / (rho d^2) + FAST G / rho q^2. This is the even fit, for 1.3 <= q d
# <= 8, to the lowest normal mode of an incompressible layer bonded to a rigid base. Its frequency
# is within 3.0 % of the root of the mode's determinant. Its group speed is not: it is 0.36 c_T
# instead of 0.93 at q d = 1.3, 0.53 for 0.38 at 2.2, and 0.82 for 0.93 at 8.
STIFF = 6.527
FAST = 0.7668

# The kinetic energy of the mode is that of a mass MASS rho d that moves as the surface does. In the
# range of the fit the factor is 0.56 to 0.95, the least for short waves; this is the geometric
# mean.
MASS = 0.665

# Shortest and longest wave, over the thickness, for which the fit holds.
SHORTEST = 2 * np.pi / 8
LONGEST = 2 * np.pi / 1.3

# The fit for short waves, q d >= 5, where group speeds are even as well: the phase speed is within
# 2.6 %, the group speed within 3.5 %.
_SHORT_STIFF = 4.263
_SHORT_FAST = 0.8781

# The mean for 5 <= q d <= 16, where it falls from 0.68 to 0.31.
_SHORT_MASS = 0.517

# Longest wave, over the thickness, for which the fit for short waves holds.
_SHORT_LONGEST = 2 * np.pi / 5

# Greatest power with which tension may follow the area, either way.
_MOST_TIGHTENING = 8.0

# Least Poisson's ratio. At -1 a sheet would resist only changes of its shape, and its rigidity
# would be infinite.
_LEAST_POISSON = -0.9

# Texels of the shortest wave that is solved well: a shorter one is slower than it should be by more
# than a twentieth.
SHORTEST_TEXELS = 6.0


class Default(float):
    """The default of a coefficient that is not given.

    `WaveSolver` takes the number as it stands. `Ripples` knows the model, and replaces it by one
    that suits its target.
    """

    __slots__ = ()


_ZERO = Default(0.0)
_ONE = Default(1.0)


@dataclasses.dataclass(frozen=True, eq=False)
class Material:
    """Coefficients of the wave equation; each is a number or one value a texel, shape [C, n, n].

    sigma h_tt = div(sigma c^2 grad h) - lap(sigma b lap h) - sigma zeta h_t - sigma k h + div(sigma
    nu grad h_t) - p, with p the pressure from outside. A wave of wave number q has omega^2 = c^2
    q^2 + b q^4 + k - (zeta + nu q^2)^2 / 4 and dies as exp(-(zeta + nu q^2) t / 2).

    Attributes
    ----------
    speed : c [m/s]
        Wave speed of tension. Where it is 0 nothing propagates: waves reflect as from a free rim,
        and a region without tension, bending and stiffness is rigid, so that sources do not move
        it. Where all three fade, the speed below 3 % of the greatest, the share of a source that
        moves the surface fades as well; the body below takes the rest, and loads do not sink in
        forever.
    damping : zeta [1/s]
        The amplitude of every wave falls as exp(-zeta t / 2).
    stiffness : k [1/s^2]
        Pull back to the undeformed surface, for each kg/m^2; a lone texel would swing at sqrt(k).
    viscosity : nu [m^2/s]
        Damps a wave of wave number q as exp(-nu q^2 t / 2): short ripples first.
    density : sigma [kg/m^2]
        Mass that takes part in the motion, for each area. An impulse J raises the momentum of the
        surface by J.
    bending : b [m^4/s^2]
        Resistance of a plate to being bent, rigidity over density: omega = sqrt(b) q^2, short
        ripples are faster.
    yield_height : [m]
        Deformation beyond it is permanent (see `dent`). Infinite: fully elastic.
    poisson : nu
        Poisson's ratio, which counts at the rims of a surface that bends: one number from -0.9 to
        0.5.
    fixed : bool
        Where True, the surface is clamped: its height stays 0 and waves come back inverted.
    deep : [1/m]
        With deep fluid below, whose flow makes long waves heavier: the wave number q_0 at which it
        weighs sigma. Of another wave number q it weighs sigma q_0 / q, so that omega^2 is q / q_0
        times the one above. 0: no fluid. One number, with one density; see `water`.
    tightening : float
        On a surface that moves, see `WaveSolver.move`: c^2 grows as this power of the area over
        that at rest. 0: waves stay as fast as they are; 1: the tension stays, as of a soap film;
        more: the tension grows, as of rubber.
    wavelengths : (float, float)
        Shortest and longest wave for which the coefficients stand for the real material [m].
        `WaveSolver` warns where an atlas has room for none of them.

    A density that is not given is 1 to `WaveSolver`, which knows nothing of a scale. `Ripples`
    takes it from the model, and with it those of speed, damping and stiffness that are not given;
    see `suited_material`.
    """

    speed: float | ArrayLike = _ONE
    damping: float | ArrayLike = _ZERO
    stiffness: float | ArrayLike = _ZERO
    viscosity: float | ArrayLike = 0.0
    density: float | ArrayLike = _ONE
    bending: float | ArrayLike = 0.0
    yield_height: float | ArrayLike = np.inf
    deep: float = 0.0
    poisson: float = 0.3
    fixed: bool | ArrayLike = False
    tightening: float = 0.0
    wavelengths: ArrayLike = (0.0, np.inf)

    def __post_init__(self) -> None:
        for name in LIMITS:
            check_numbers(name, getattr(self, name))
        check_mask("fixed", self.fixed)
        if not (is_finite(self.tightening) and abs(self.tightening) <= _MOST_TIGHTENING):
            raise SolverError(
                f"material tightening must be a number from {-_MOST_TIGHTENING:g} to "
                f"{_MOST_TIGHTENING:g}, got {shown(self.tightening)}"
            )
        if not (is_finite(self.poisson) and _LEAST_POISSON <= self.poisson <= 0.5):
            raise SolverError(
                f"material poisson must be a number from {_LEAST_POISSON} to 0.5, got "
                f"{shown(self.poisson)}"
            )
        if np.ndim(self.deep):
            raise SolverError(f"material deep must be one number, got shape {np.shape(self.deep)}")
        check_wavelengths(self.wavelengths)

    @property
    def unset(self) -> tuple[str, ...]:
        """Names of the coefficients that are left to the model: none where the density is given."""
        if not isinstance(self.density, Default):
            return ()
        return tuple(name for name in LIMITS if isinstance(getattr(self, name), Default))

    def texels(self, name: str, shape: tuple[int, int, int]) -> NDArray:
        """One coefficient at every texel, [C, n, n], float64 (bool for `fixed`).

        Raises
        ------
        SolverError
            If the coefficient was given for another atlas.
        """
        value = np.asarray(getattr(self, name), dtype=bool if name == "fixed" else np.float64)
        if value.ndim and value.shape != shape:
            raise SolverError(
                f"material {name} has shape {value.shape}, the atlas needs a number or {shape}"
            )
        return np.array(np.broadcast_to(value, shape))

    @classmethod
    def membrane(cls, tension: float = 1.0, density: float = 1.0, damping: float = 0.0) -> Self:
        """Stretched skin: omega = c q with c = sqrt(tension / density), for waves of any length.

        Parameters
        ----------
        tension : [N/m]
        density : [kg/m^2]
        damping : [1/s]
        """
        require_positive(tension=(tension, "N/m"), density=(density, "kg/m^2"))
        return cls(speed=(tension / density) ** 0.5, density=density, damping=damping)

    @classmethod
    def layer(
        cls,
        modulus: float,
        viscosity: float = 0.0,
        density: float = 1000.0,
        thickness: float | ArrayLike = 0.05,
        short: bool = False,
    ) -> Self:
        """Soft layer bonded to a rigid core: a thin layer is stiff and soon still.

        Normal impacts drive the lowest normal mode of an incompressible Kelvin-Voigt layer on a
        rigid base, whose modulus is G + eta d/dt. With c_T^2 = G / rho its
        frequency is, within 3.0 % for 1.3 <= q d <= 8, omega^2 = 6.527 (c_T / d)^2 + 0.7668 c_T^2
        q^2, a fit to the zeros of the mode's determinant (Achenbach 1973, chapter 6, for the waves
        in a layer); waves shorter than 0.8 d or longer than 4.8 d are outside of it. A ring, which
        travels with the group speed, needs `short` unless the layer is thin for it. All forces in
        the layer go with the modulus, so that eta gives damping and viscosity in the same two
        terms. The density is the mode's share of the layer's mass, 0.665 rho d, within a quarter
        for 1.6 <= q d <= 8.

        Parameters
        ----------
        modulus : G [Pa]
            Shear modulus.
        viscosity : eta [Pa s]
        density : rho [kg/m^3]
        thickness : d [m]
            A number, or one at every texel, [C, n, n].
        short : bool
            Fitted to waves shorter than 1.26 d, as a small drop sends over a thick layer: 4.263 and
            0.8781 are then the two factors, for q d >= 5, with the phase speed within 2.6 % and the
            group speed within 3.5 %, and the mass is 0.517 rho d.

        Raises
        ------
        SolverError
            If a number is not finite and greater than 0; the viscosity may be 0.
        """
        require_positive(modulus=(modulus, "Pa"), density=(density, "kg/m^3"))
        if not (is_finite(viscosity) and viscosity >= 0):
            raise SolverError(
                f"viscosity must be a finite number, 0 or greater, got {shown(viscosity)} Pa s"
            )
        depth = _thickness(thickness)
        square = modulus / density
        kinematic = viscosity / density
        if short:
            stiff = _SHORT_STIFF
            fast = _SHORT_FAST
            mass = _SHORT_MASS
            shortest = 0.0
            longest = _SHORT_LONGEST
        else:
            stiff = STIFF
            fast = FAST
            mass = MASS
            shortest = SHORTEST
            longest = LONGEST
        return cls(
            speed=(fast * square) ** 0.5,
            stiffness=stiff * square / depth**2,
            viscosity=fast * kinematic,
            damping=stiff * kinematic / depth**2,
            density=mass * density * depth,
            # waves for which the fit holds somewhere: at the thinnest or at the thickest place
            wavelengths=(shortest * float(np.min(depth)), longest * float(np.max(depth))),
        )

    @classmethod
    def water(
        cls,
        density: float = 1000.0,
        tension: float = 0.072,
        gravity: float = 9.81,
        viscosity: float = 1e-6,
    ) -> Self:
        """Deep liquid under gravity and surface tension: omega^2 = g q + (gamma / rho) q^3.

        Long waves run faster than those of about the crossing length 2 pi sqrt(gamma / (rho g)), 17
        mm for water, and so do short ones. Gravity pulls along the inward normal everywhere, and
        the liquid is deeper than half a wave and flat: the flow below takes the square root of the
        surface's Laplacian, by a rational approximation, see `HalfLaplacian`. It always runs on the
        CPU, and a substep takes as long as some 500 of other materials. Volume is kept in any case,
        and a push moves the liquid around it as well: J is not the sum of sigma A dv.

        Parameters
        ----------
        density : rho [kg/m^3]
        tension : gamma [N/m]
        gravity : g [m/s^2]
        viscosity : nu [m^2/s]
            Kinematic, of a clean surface: waves die as exp(-2 nu q^2 t) (Lamb 1932, section 348).

        Raises
        ------
        SolverError
            If a number is not finite and greater than 0; the viscosity may be 0.
        """
        require_positive(
            density=(density, "kg/m^3"), tension=(tension, "N/m"), gravity=(gravity, "m/s^2")
        )
        crossover = (density * gravity / tension) ** 0.5
        return cls(
            speed=(gravity / crossover) ** 0.5,
            stiffness=gravity * crossover,
            viscosity=4 * viscosity,
            density=density / crossover,
            deep=crossover,
        )

    @classmethod
    def plate(
        cls,
        modulus: float = 1e6,
        thickness: float = 0.01,
        density: float = 1000.0,
        poisson: float = 0.3,
        damping: float = 0.0,
    ) -> Self:
        """Thin elastic shell that resists bending only: omega = sqrt(D / sigma) q^2, dispersive.

        Kirchhoff's plate: rigidity D = E d^3 / 12 (1 - nu^2), sigma = rho d. The surface's own
        curvature is left out.

        Parameters
        ----------
        modulus : E [Pa]
        thickness : d [m]
        density : rho [kg/m^3]
        poisson : nu
            From -0.9 to 0.5.
        damping : [1/s]
        """
        require_positive(
            modulus=(modulus, "Pa"), thickness=(thickness, "m"), density=(density, "kg/m^3")
        )
        # checks Poisson's ratio, which the rigidity needs
        plate = cls(speed=0.0, poisson=poisson, damping=damping)
        rigidity = modulus * thickness**3 / (12 * (1 - poisson**2))
        surface_density = density * thickness
        return dataclasses.replace(
            plate, bending=rigidity / surface_density, density=surface_density
        )

    @classmethod
    def dent(
        cls,
        yield_height: float,
        stiffness: float = 1000.0,
        speed: float = 1.0,
        damping: float = 1.0,
        density: float = 1.0,
    ) -> Self:
        """Ideally plastic ground: deformation beyond the yield height is permanent.

        Height is elastic plus permanent. Waves act on the elastic part, which never exceeds the
        yield height: while it stands at the limit the ground flows under the constant resistance
        sigma k yield_height, and the flow is permanent. A uniform push at velocity v leaves (v^2 /
        k - yield_height^2) / (2 yield_height).

        Parameters
        ----------
        yield_height : [m]
        stiffness : k [1/s^2]
        speed : c [m/s]
        damping : zeta [1/s]
        density : sigma [kg/m^2]
        """
        return cls(
            speed=speed,
            damping=damping,
            stiffness=stiffness,
            density=density,
            yield_height=yield_height,
        )

    @classmethod
    def suited(
        cls,
        size: float,
        hit: float | tuple[float, float],
        *,
        radius: float | None = None,
        amplitude: float = 0.05,
        crossing: float = 0.5,
        decay: float = 1.5,
    ) -> Self:
        """Ripples that look right on an object of any size, from a marble to a building.

        The eye sees how long waves take. So most coefficients follow from times, and the density
        from how hard the object is hit:

        - speed c = size / crossing;
        - density: a short hit J on a footprint of radius r makes a dent of amplitude times size at
          most, see `density_for`: sigma = 0.385 J / (c r amplitude size);
        - stiffness k = (16 c / size)^2, so that a dent is narrow, and crest follows crest; more
          where the body of the hit would otherwise sink by more than half of that amplitude when it
          rests;
        - damping zeta = 2 ln(10) / decay: waves fall to a tenth in that time;
        - viscosity nu = 0.001 c size: ripples shorter than a tenth of the size die on their way
          across it.

        Parameters
        ----------
        size : float
            Of the object, its longest extent [m].
        hit : float or (float, float)
            A typical hit: its impulse [N s], or the mass [kg] and the speed [m/s] of a body, which
            then gives 1.5 m v.
        radius : float, optional
            Of a typical footprint [m], about half the radius of what hits; by default a twentieth
            of the size, and a fortieth at least.
        amplitude : float
            Deepest dent of a typical hit, over the size.
        crossing : float
            Time in which waves cross the object [s].
        decay : float
            Time in which they fall to a tenth [s].

        Raises
        ------
        SolverError
            If a number is not finite and greater than 0.
        """
        return cls(**suited_coefficients(size, hit, radius, amplitude, crossing, decay))

    @classmethod
    def jelly(
        cls,
        modulus: float = 500.0,
        viscosity: float = 2.0,
        thickness: float = 0.1,
        density: float = 1000.0,
    ) -> Self:
        """Soft jelly on a rigid core: a `layer` that wobbles at its own frequency and settles.

        Parameters
        ----------
        modulus : G [Pa]
            Shear modulus; gelatine has 100 to 10,000.
        viscosity : eta [Pa s]
        thickness : d [m]
        density : rho [kg/m^3]
        """
        return cls.layer(modulus, viscosity, density, thickness)

    @classmethod
    def preset(cls, name: str, **parameters: Any) -> Self:
        """Material by name, as `preset` of a scene file has it.

        Parameters
        ----------
        name : str
            Name of a real material in `PRESETS`, such as "gelatine-3", or of a constructor, such as
            "jelly" or "water".
        parameters
            Parameters of the constructor that are to be others, in its units.

        Raises
        ------
        SolverError
            For an unknown name or parameter, or a missing one.
        """
        names = (*LAWS, *PRESETS)
        if not isinstance(name, str) or name not in names:
            raise SolverError(f"preset must be one of {', '.join(names)}, got {shown(name)}")
        real = PRESETS.get(name)
        law = getattr(cls, name if real is None else real.law)
        usual = {} if real is None else real.parameters
        valid = inspect.signature(law).parameters
        unknown = [key for key in parameters if key not in valid]
        if unknown:
            raise SolverError(
                f"the preset {name!r} has no parameter {unknown[0]!r}; its parameters are "
                f"{', '.join(valid)}"
            )
        chosen = {**usual, **parameters}
        for key, parameter in valid.items():
            if parameter.default is inspect.Parameter.empty and key not in chosen:
                raise SolverError(
                    f"the preset {name!r} needs {key}: write Material.preset({name!r}, {key}=...)"
                )
        return law(**chosen)


def _thickness(value: Any) -> float | NDArray[np.float64]:
    """The thickness of a layer [m], a number or an array, if it is greater than 0 everywhere."""
    if np.ndim(value) == 0:  # so is that of a string
        require_positive(thickness=(value, "m"))
        return float(value)
    depth = np.asarray(value)
    holds_numbers = depth.size > 0 and np.issubdtype(depth.dtype, np.number)
    wrong = ~(np.isfinite(depth) & (depth > 0)) if holds_numbers else np.ones(1, np.bool_)
    if wrong.any():
        worst = depth.tolist() if depth.size == 0 else depth.flat[np.argmax(wrong)].item()
        raise SolverError(
            f"thickness must be {POSITIVE.words}, or one such number at every texel, got "
            f"{shown(worst)} m"
        )
    return depth.astype(np.float64)


def frequency(material: Material, wave_number: float) -> float:
    """Angular frequency [1/s] of a wave of a wave number [1/m].

    0 where the wave creeps back without swinging.
    """
    q2 = wave_number**2
    rate = 1 / decay_time(material, wave_number)
    square = _number(material, "speed") ** 2 * q2 + _number(material, "bending") * q2**2
    square += _number(material, "stiffness")
    if material.deep:
        square *= wave_number / material.deep
    return float(np.sqrt(max(square - rate**2, 0.0)))


def phase_speed(material: Material, wave_number: float) -> float:
    """Speed of a wave's crests [m/s]."""
    return frequency(material, wave_number) / wave_number


def decay_time(material: Material, wave_number: float) -> float:
    """Time in which a wave falls to 1/e [s], infinite without damping."""
    rate = (_number(material, "damping") + _number(material, "viscosity") * wave_number**2) / 2
    return float("inf") if rate == 0 else 1 / rate


def _number(material: Material, name: str) -> float:
    """A coefficient of a uniform material."""
    return float(np.asarray(getattr(material, name)))


def warn_of_wavelengths(atlas: Atlas, material: Material) -> None:
    """Warn where the coefficients of a material hold for no wave that fits on an atlas."""
    shortest, longest = np.asarray(material.wavelengths, dtype=np.float64)
    areas = atlas.areas
    texel = float(np.sqrt(np.mean(areas)))  # width of a texel [m]
    whole = float(np.sqrt(np.pi * areas.sum()))  # way round a sphere of the same area [m]
    finest = SHORTEST_TEXELS * texel
    if longest < finest:
        resolution = int(np.ceil(np.sqrt(areas.size / 6) * finest / longest))
        message = (
            f"the material holds for waves up to {longest:.3g} m, and texels of {texel:.2g} m "
            f"carry none below {finest:.3g} m; take a resolution of {resolution}, or a thicker "
            "layer"
        )
    elif shortest > whole:
        message = (
            f"the material holds for waves from {shortest:.3g} m on, and the surface is "
            f"{whole:.3g} m round; take a thinner layer"
        )
    else:
        return
    warn_caller(message)
