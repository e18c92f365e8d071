"""Materials: the coefficients of the wave equation, as numbers, as maps, and as presets."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver.errors import SolverError

from .coefficients import LIMITS, check_mask, check_numbers, require_positive
from .layer import layer_coefficients, layer_wavelengths
from .presets import preset_named
from .suited import suited_coefficients
from .unset import Unset

_ZERO, _ONE = Unset(0.0), Unset(1.0)


@dataclasses.dataclass(frozen=True, eq=False)
class Material:
    """Coefficients of the wave equation; each is a number or one value a texel, shape [C, n, n].

    sigma h_tt = div(sigma c^2 grad h) - lap(sigma b lap h) - sigma zeta h_t - sigma k h + div(sigma nu grad h_t) - p,
    with p the pressure from outside. A wave of wave number q has omega^2 = c^2 q^2 + b q^4 + k - (zeta + nu q^2)^2 / 4
    and dies as exp(-(zeta + nu q^2) t / 2).

    Attributes
    ----------
    speed : c [m/s]
        Wave speed of tension. Where it is 0 nothing propagates: waves reflect as from a free rim, and a region
        without tension, bending and stiffness is rigid, so that sources do not move it. Where it fades below 3 % of the
        greatest, with the other two, so does the share of a source that moves the surface; what lies below takes the
        rest, and loads do not sink in for ever.
    damping : zeta [1/s]
        The amplitude of every wave falls as exp(-zeta t / 2).
    stiffness : k [1/s^2]
        Pull back to the undeformed surface, for each kg/m^2; a lone texel would swing at sqrt(k).
    viscosity : nu [m^2/s]
        Damps a wave of wave number q as exp(-nu q^2 t / 2): short ripples first.
    density : sigma [kg/m^2]
        Mass that takes part in the motion, for each area. An impulse J raises the momentum of the surface by J.
    bending : b [m^4/s^2]
        Resistance of a plate to being bent, rigidity over density: omega = sqrt(b) q^2, short ripples are faster.
    yield_height : [m]
        Deformation beyond it is permanent (see `dent`). Infinite: fully elastic.
    fixed : bool
        Where True, the surface is clamped: its height stays 0 and waves come back inverted.
    wavelengths : (float, float)
        Shortest and longest wave for which the coefficients stand for the real material [m]. `WaveSolver` warns where
        an atlas has room for none of them.

    A density that is not given is 1 to `WaveSolver`, which knows nothing of a scale. `Ripples` takes it from the model,
    and with it those of speed, damping and stiffness that are not given; see `suited_material`.
    """

    speed: float | ArrayLike = _ONE
    damping: float | ArrayLike = _ZERO
    stiffness: float | ArrayLike = _ZERO
    viscosity: float | ArrayLike = 0.0
    density: float | ArrayLike = _ONE
    bending: float | ArrayLike = 0.0
    yield_height: float | ArrayLike = np.inf
    fixed: bool | ArrayLike = False
    wavelengths: ArrayLike = (0.0, np.inf)

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
    ) -> Material:
        """Ripples that look right on an object of any size, from a marble to a building.

        The time that waves take is what the eye sees, so speed and the like follow from times, and the density from how
        hard the object is hit:

        - speed c = size / crossing;
        - density: a short hit J on a footprint of radius r makes a dent of amplitude times size at most, see
          `density_for`: sigma = 0.385 J / (c r amplitude size);
        - stiffness k = (16 c / size)^2, so that a dent is narrow, and crest follows crest; more where the body of the
          hit would otherwise sink by more than half of that amplitude when it rests;
        - damping zeta = 2 ln(10) / decay: waves fall to a tenth in that time;
        - viscosity nu = 0.001 c size: ripples shorter than a tenth of the size die on their way across it.

        Parameters
        ----------
        size : float
            Of the object, its longest extent [m].
        hit : float or (float, float)
            A typical hit: its impulse [N s], or the mass [kg] and the speed [m/s] of a body, which then gives 1.5 m v.
        radius : float, optional
            Of a typical footprint [m], about half the radius of what hits; by default a twentieth of the size.
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
    def membrane(cls, tension: float = 1.0, density: float = 1.0, damping: float = 0.0) -> Material:
        """Stretched skin: omega = c q with c = sqrt(tension / density), the same for all wave lengths.

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
        cls, modulus: float, viscosity: float = 0.0, density: float = 1000.0, thickness: float | ArrayLike = 0.05
    ) -> Material:
        """Soft layer bonded to a rigid core: where it is thin it is stiff and soon still, where thick soft and slow.

        The waves that normal impacts drive: the lowest normal mode of an incompressible Kelvin-Voigt layer on a rigid
        base, whose modulus is G + eta d/dt. With c_T^2 = G / rho its frequency is, within 3.0 % for 1.3 <= q d <= 8,
        omega^2 = 6.527 (c_T / d)^2 + 0.7668 c_T^2 q^2, a fit to the zeros of the mode's determinant (Achenbach 1973,
        chapter 6, for the waves in a layer); waves shorter than 0.8 d or longer than 4.8 d are outside of it.
        All forces in the layer go with the modulus, so that eta gives damping and viscosity in the same two terms.
        The density is the mode's share of the layer's mass, 0.665 rho d, within a quarter for 1.6 <= q d <= 8.

        Parameters
        ----------
        modulus : G [Pa]
            Shear modulus.
        viscosity : eta [Pa s]
        density : rho [kg/m^3]
        thickness : d [m]
            A number, or one at every texel, [C, n, n].

        Raises
        ------
        SolverError
            If a number is not finite and greater than 0; the viscosity may be 0.
        """
        coefficients = layer_coefficients(modulus, viscosity, density, thickness)
        return cls(**coefficients, wavelengths=layer_wavelengths(thickness))

    @classmethod
    def jelly(
        cls, modulus: float = 500.0, viscosity: float = 2.0, thickness: float = 0.1, density: float = 1000.0
    ) -> Material:
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
    def preset(cls, name: str, **parameters: float) -> Material:
        """Real material by its name in `PRESETS`, with some parameters of its constructor changed.

        Raises
        ------
        SolverError
            For an unknown name or parameter.
        """
        chosen = preset_named(name)
        unknown = [key for key in parameters if key not in chosen.parameters]
        if unknown:
            valid = ", ".join(chosen.parameters)
            raise SolverError(f"the preset {name!r} has no parameter {unknown[0]!r}; valid are {valid}")
        return getattr(cls, chosen.law)(**{**chosen.parameters, **parameters})

    @classmethod
    def plate(
        cls,
        modulus: float = 1e6,
        thickness: float = 0.01,
        density: float = 1000.0,
        poisson: float = 0.3,
        damping: float = 0.0,
    ) -> Material:
        """Thin elastic shell that resists bending only: omega = sqrt(D / sigma) q^2, dispersive.

        Kirchhoff's plate: rigidity D = E d^3 / 12 (1 - nu^2), sigma = rho d. The surface's own curvature is left out.

        Parameters
        ----------
        modulus : E [Pa]
        thickness : d [m]
        density : rho [kg/m^3]
        poisson : nu
            From 0 up to 0.5.
        damping : [1/s]
        """
        require_positive(modulus=(modulus, "Pa"), thickness=(thickness, "m"), density=(density, "kg/m^3"))
        if not 0 <= poisson <= 0.5:
            raise SolverError(f"plate poisson is {poisson!r}; valid is a number from 0 to 0.5")
        rigidity = modulus * thickness**3 / (12 * (1 - poisson**2))
        surface_density = density * thickness
        return cls(speed=0.0, bending=rigidity / surface_density, density=surface_density, damping=damping)

    @classmethod
    def dent(
        cls,
        yield_height: float,
        stiffness: float = 1000.0,
        speed: float = 1.0,
        damping: float = 1.0,
        density: float = 1.0,
    ) -> Material:
        """Ideally plastic ground: deformation beyond the yield height is permanent.

        Height is elastic plus permanent. Waves act on the elastic part, which never exceeds the yield height: while it
        stands at the limit the ground flows under the constant resistance sigma k yield_height, and the flow is
        permanent. A uniform push at velocity v leaves (v^2 / k - yield_height^2) / (2 yield_height).

        Parameters
        ----------
        yield_height : [m]
        stiffness : k [1/s^2]
        speed : c [m/s]
        damping : zeta [1/s]
        density : sigma [kg/m^2]
        """
        return cls(speed=speed, damping=damping, stiffness=stiffness, density=density, yield_height=yield_height)

    def __post_init__(self) -> None:
        for name in LIMITS:
            check_numbers(name, getattr(self, name))
        check_mask("fixed", self.fixed)

    @property
    def unset(self) -> tuple[str, ...]:
        """Names of the coefficients that are left to the model: none where the density is given."""
        if not isinstance(self.density, Unset):
            return ()
        return tuple(name for name in LIMITS if isinstance(getattr(self, name), Unset))

    def texels(self, name: str, shape: tuple[int, int, int]) -> NDArray:
        """One coefficient at every texel, [C, n, n], float64 (bool for `fixed`).

        Raises
        ------
        SolverError
            If the coefficient was given for another atlas.
        """
        value = np.asarray(getattr(self, name), dtype=bool if name == "fixed" else np.float64)
        if value.ndim and value.shape != shape:
            raise SolverError(f"material {name} has shape {value.shape}, the atlas needs a number or {shape}")
        return np.array(np.broadcast_to(value, shape))
