"""Whether an atlas has room for the waves that a material's coefficients stand for."""

from __future__ import annotations

import warnings

import numpy as np

from ..errors import RippleWarning
from ..texels.atlas import Atlas
from .material import Material

# A wave of fewer texels is slower than it should be by more than a twentieth.
_TEXELS = 6.0


def warn_of_wavelengths(atlas: Atlas, material: Material) -> None:
    """Warn where no wave that fits on an atlas is one that the material's coefficients hold for."""
    shortest, longest = np.asarray(material.wavelengths, dtype=np.float64)
    areas = atlas.areas
    finest, whole = _TEXELS * float(np.sqrt(np.mean(areas))), float(np.sqrt(np.pi * areas.sum()))
    if longest < finest:
        resolution = int(np.ceil(np.sqrt(areas.size / 6) * finest / longest))
        warnings.warn(
            f"the material holds for waves up to {longest:.3g} m, and texels of {finest / _TEXELS:.2g} m carry none "
            f"below {finest:.3g} m; take a resolution of {resolution}, or a thicker layer",
            RippleWarning,
            stacklevel=4,
        )
    elif shortest > whole:
        warnings.warn(
            f"the material holds for waves from {shortest:.3g} m on, and the surface is {whole:.3g} m round; take a "
            "thinner layer",
            RippleWarning,
            stacklevel=4,
        )
