"""Materials: the coefficients of the wave equation, from laws, from what is seen, and as presets."""

from __future__ import annotations

from typing import Self

from ..errors import SolverError
from .material_laws import MaterialLaws
from .presets import preset_named
from .suited import suited_coefficients


class Material(MaterialLaws):
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
    deep : [1/m]
        With deep fluid below, whose flow makes long waves heavier: the wave number q_0 at which it weighs sigma. Of
        another wave number q it weighs sigma q_0 / q, so that omega^2 is q / q_0 times the one above. 0: no fluid. One
        number, with one density; see `water`.
    tightening : float
        On a surface that moves, see `WaveSolver.move`: c^2 grows as this power of the area over that at rest. 0: waves
        stay as fast as they are; 1: the tension stays, as of a soap film; more: the tension grows, as of rubber.
    wavelengths : (float, float)
        Shortest and longest wave for which the coefficients stand for the real material [m]. `WaveSolver` warns where
        an atlas has room for none of them.

    A density that is not given is 1 to `WaveSolver`, which knows nothing of a scale. `Ripples` takes it from the model,
    and with it those of speed, damping and stiffness that are not given; see `suited_material`.
    """

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
    def jelly(
        cls, modulus: float = 500.0, viscosity: float = 2.0, thickness: float = 0.1, density: float = 1000.0
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
    def preset(cls, name: str, **parameters: float) -> Self:
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
