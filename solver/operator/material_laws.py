"""Materials from the laws of physics: a membrane, a layer, a liquid, a plate, plastic ground."""

from __future__ import annotations

from typing import Self

from numpy.typing import ArrayLike

from ..checked import is_finite, shown
from ..errors import SolverError
from .coefficients import require_positive
from .layer import layer_coefficients, layer_wavelengths
from .material_fields import MaterialFields


class MaterialLaws(MaterialFields):
    """Constructors of `Material`, one for each law."""

    @classmethod
    def membrane(cls, tension: float = 1.0, density: float = 1.0, damping: float = 0.0) -> Self:
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
    ) -> Self:
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
    def water(
        cls, density: float = 1000.0, tension: float = 0.072, gravity: float = 9.81, viscosity: float = 1e-6
    ) -> Self:
        """Deep liquid under gravity and surface tension: omega^2 = g q + (gamma / rho) q^3.

        Long waves run faster than those of about the crossing length 2 pi sqrt(gamma / (rho g)), 17 mm for water, and
        so do short ones. Gravity pulls along the inward normal everywhere, and the liquid is deeper than half a wave
        and flat: the flow below takes the square root of the surface's Laplacian, by a rational approximation, see
        `HalfLaplacian`. It always runs on the CPU, and a substep takes as long as some 500 of other materials.
        Volume is kept in any case, and a push moves the liquid around it as well: J is not the sum of sigma A dv.

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
        require_positive(density=(density, "kg/m^3"), tension=(tension, "N/m"), gravity=(gravity, "m/s^2"))
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
        if not (is_finite(poisson) and 0 <= poisson <= 0.5):
            raise SolverError(f"plate poisson is {shown(poisson)}; valid is a number from 0 to 0.5")
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
    ) -> Self:
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
