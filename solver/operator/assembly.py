"""From an atlas and a material to the wave operator: finite elements, or a baseline to compare them with."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverError
from ..texels.atlas import Atlas
from ..texels.links import EAST, LINK_ENDS, NORTH, link_lengths, mean_of_copies
from ..texels.softening import softening
from ..texels.stencil import Stencil
from ..texels.texel_mesh import TexelMesh
from .coefficients import LIMITS
from .fluid_operator import over_fluid
from .material import Material
from .rims import RIMS
from .wave_operator import WaveOperator

OPERATORS = ("fem", "paper", "uncorrected", "dynamic-paint")

# Below this share of the greatest pull on the surface sources lose their grip: where waves run at 3 % of the speed.
_FAINT = 1e-3


def build_operator(atlas: Atlas, material: Material, kind: str, rim: str = "free") -> WaveOperator:
    """Assemble the operator of a material on an atlas.

    Parameters
    ----------
    atlas : Atlas
    material : Material
    kind : str
        "fem": symmetric, second-order accurate finite elements. The others are baselines for comparison:
        "paper": (c/d)^2 (h_j - h_i) over 4 neighbours at real distances d (Kira, Nakayama, Fujishiro, with the printed
        (d/s)^2 put right); "uncorrected": the same with one mean distance everywhere (their figure 6a);
        "dynamic-paint": the same sum at real distances over 8 neighbours, as Blender's Dynamic Paint takes it.

    rim : str
        "free", or "fixed": heights are 0 at rims, and so are a plate's moments.

    Raises
    ------
    SolverError
        For an unknown kind or rim, or a material of another resolution.
    """
    if rim not in RIMS:
        raise SolverError(f"rim {rim!r} does not exist; valid are {', '.join(map(repr, RIMS))}")
    if kind not in OPERATORS:
        raise SolverError(f"operator {kind!r} does not exist; valid are {', '.join(map(repr, OPERATORS))}")
    texels, field = texel_fields(atlas, material, rim)
    density, area = field["density"], atlas.areas
    if kind == "fem":
        assemble = functools.partial(texels.stencil, softening=softening(texels))
    else:
        # these formulas give accelerations without masses: one area for all keeps the units, one density as well
        area, density = np.full_like(area, area.mean()), np.full_like(density, density.mean())
        assemble = functools.partial(_difference_stencil, texels, kind, area[0, 0, 0])
    viscous, bends, yields = field["viscosity"].any(), field["bending"].any(), np.isfinite(field["yield_height"]).any()
    operator = WaveOperator(
        stencil=assemble(density * field["speed"] ** 2),
        mass=density * area,
        damping=field["damping"],
        stiffness=field["stiffness"],
        viscous_stencil=assemble(density * field["viscosity"]) if viscous else None,
        laplace_stencil=assemble(np.ones_like(area)) if bends else None,
        rigidity=density * field["bending"] / area if bends else None,
        yield_height=field["yield_height"] if yields else None,
        fixed=field["fixed"] if field["fixed"].any() else None,
        density=density if np.ptp(density) else None,
        grip=source_grip(field["speed"] ** 2, field["stiffness"], field["bending"]),
    )
    return over_fluid(operator, material.deep, assemble(np.ones_like(area)), area) if material.deep else operator


def texel_fields(atlas: Atlas, material: Material, rim: str) -> tuple[TexelMesh, dict[str, NDArray]]:
    """Texel mesh with its rim, and the coefficients of a material at each of its texels, [C, n, n]."""
    field = {name: material.texels(name, atlas.areas.shape) for name in (*LIMITS, "fixed")}
    texels = atlas.texels
    if rim == "fixed":
        texels = texels.with_fixed_rim()
        field["fixed"] |= texels.bare_rim
    # rigid texels are not dragged along by their neighbours either
    moves = (field["speed"] > 0) | (field["stiffness"] > 0) | (field["bending"] > 0)
    if moves.any():
        field["viscosity"] *= moves
    return texels, field


def source_grip(*pulls: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Share of a source that sets each texel in motion, [C, n, n], by what pulls it back, each [C, n, n]; None: all.

    A texel without a pull is rigid. One with next to none would sink ever deeper under a load: as the strongest pull
    on a texel fades, against the greatest of its kind on the surface, so does the grip of sources. The deflection under
    a load then stays in proportion to that elsewhere.
    """
    strongest = np.max([pull / pull.max() for pull in pulls if pull.any()], axis=0, initial=0.0)
    if not strongest.any() or strongest.min() >= _FAINT:
        return None
    return np.minimum(1.0, strongest / _FAINT)


def _difference_stencil(texels: TexelMesh, kind: str, area: float, coefficient: NDArray[np.float64]) -> Stencil:
    """Link weights area coefficient / distance^2 of the baselines, which know no links beyond the nine points."""
    lengths = link_lengths(texels.topology, texels.halo_positions)
    if kind != "dynamic-paint":
        lengths[:, [link for link in range(4) if link not in (EAST, NORTH)]] = np.inf
    if kind == "uncorrected":
        finite = np.isfinite(lengths)
        lengths[finite] = lengths[finite].mean()
    lengths[lengths == 0] = np.inf
    c = texels.topology.with_halo(coefficient)
    means = np.stack([(c[a] + c[b]) / 2 for a, b in LINK_ENDS], axis=1)
    return Stencil(texels.topology, mean_of_copies(texels.topology, area * means / lengths**2))
