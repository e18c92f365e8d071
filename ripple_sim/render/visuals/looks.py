"""Looks: named sets of parameters for the surface of a target."""

from __future__ import annotations

from dataclasses import dataclass

from ripple_sim.solver.errors import RippleError

# The look that takes colour, texture and gloss from the geom's MuJoCo material.
MODEL_LOOK = "model"


@dataclass(frozen=True)
class Look:
    """Parameters of the surface shader.

    Attributes
    ----------
    color : tuple
        sRGB, 0 to 1; used where the surface has no colour of its own.
    roughness : float
        Of the microfacet distribution, 0 (mirror) to 1.
    metallic : float
        0 dielectric, 1 metal.
    sheen : float
        Strength of the soft glow towards the silhouette.
    coat : float
        Strength of a clear, smooth coat above the base layer, 0 to 1.
    translucency : float
        Share of the light that enters the object and leaves it elsewhere, 0 to 1.
    transparency : float
        Share of the base layer through which the surroundings are seen, refracted, 0 to 1.
    emission : float
        Radiance of its own, in units of its colour.
    """

    color: tuple[float, float, float]
    roughness: float
    metallic: float = 0.0
    sheen: float = 0.0
    coat: float = 0.0
    translucency: float = 0.0
    transparency: float = 0.0
    emission: float = 0.0


LOOKS: dict[str, Look] = {
    "rubber": Look(color=(1.0, 0.80, 0.05), roughness=0.36, sheen=0.15, coat=0.6, translucency=0.3),
    "jelly": Look(color=(0.90, 0.07, 0.20), roughness=0.14, coat=0.8, translucency=0.7, transparency=0.5),
    "skin": Look(color=(0.87, 0.62, 0.52), roughness=0.48, sheen=0.3, coat=0.25, translucency=0.55),
    "clay": Look(color=(0.80, 0.52, 0.40), roughness=0.75, sheen=0.25),
    "metal": Look(color=(0.80, 0.81, 0.84), roughness=0.22, metallic=1.0),
    "water": Look(color=(0.42, 0.76, 0.90), roughness=0.06, coat=1.0, translucency=0.15, transparency=0.9),
    MODEL_LOOK: Look(color=(0.5, 0.5, 0.5), roughness=0.42, coat=0.2),
}


def find_look(name: str) -> Look:
    """Return the look called `name`, or raise `RippleError` with the valid names."""
    if name not in LOOKS:
        raise RippleError(f"look is {name!r}; valid are {', '.join(map(repr, LOOKS))}")
    return LOOKS[name]
