"""From an atlas and a material to the wave operator.

The finite elements are those of `TexelMesh.stencil`, and at the rims of a plate those of
`plate_bending`. The operators of other methods, to compare with, are in `baselines`.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverError
from ..kernel import Floats
from ..texels.atlas import Atlas
from ..texels.stencil import NO_LINKS, IrregularLinks
from ..texels.texel_mesh import TexelMesh
from .baselines import BASELINES, Discretisation, baseline
from .bending import Bending
from .coefficients import LIMITS
from .curvatures import Curvatures
from .deep_water import over_fluid
from .material import Material
from .plate_bending import plate_bending
from .plate_rim import (
    FREE,
    RIMS,
    Rim,
    RimPlaces,
    rim_conditions,
    rim_places,
    tension_springs,
)
from .wave_operator import WaveOperator

OPERATORS = ("fem", *BASELINES)

# A texel whose pull is below this share of the greatest pull on the surface is faint: sources lose
# their grip on it. Waves run there at 3 % of the greatest speed.
_FAINT_PULL = 1e-3


def build_operator(atlas: Atlas, material: Material, kind: str, rim: Rim = "free") -> WaveOperator:
    """Assemble the operator of a material on an atlas.

    Parameters
    ----------
    atlas : Atlas
    material : Material
    kind : str
        "fem": symmetric, second-order accurate finite elements. The others are baselines for
        comparison: "paper": (c/d)^2 (h_j - h_i) over 4 neighbours at real distances d (Kira,
        Nakayama, Fujishiro, with the printed (d/s)^2 put right); "uncorrected": the same with one
        mean distance everywhere (their figure 6a); "dynamic-paint": the same sum at real distances
        over 8 neighbours, as Blender's Dynamic Paint takes it.

    rim : str or callable
        "free", "supported", "clamped" or "fixed", see `WaveSolver`. The last three are the same for
        a surface that does not bend. A plate of kind "fem" whose rim is free, supported or clamped
        has the rims of `plate_bending`. Elsewhere, and where the rim is "fixed", heights are 0 at
        rims that are not free, and so is L h.

    Raises
    ------
    SolverError
        For an unknown kind or rim, rims by region for a baseline, or a material of another
        resolution.
    """
    conditions = rim_conditions(atlas.texels, rim)
    _check_kind(kind, rim)
    bends = bool(np.any(material.bending))
    has_plate_rim = bends and kind == "fem"
    fixed_rim = rim == "fixed" or (rim in RIMS[1:] and not has_plate_rim)
    texels, field = texel_fields(atlas, material, fixed_rim)
    grip = source_grip(field["speed"] ** 2, field["stiffness"], field["bending"])

    if kind == "fem":
        soft = texels.softening()
        elements = functools.partial(texels.stencil, softening=soft)
        method = Discretisation(atlas.areas, field["density"], elements)
    else:
        method = baseline(kind, texels, atlas.areas, field["density"])
    areas = method.areas
    density = method.density
    tension = density * field["speed"] ** 2  # [N/m]
    rigidity = density * field["bending"]  # [N m]

    stencil = method.stencil(tension)
    bending: Bending | Curvatures | None = None
    laplace = None
    if bends:
        laplace = method.stencil(np.ones_like(areas))
        bending = Bending(laplace, rigidity / areas)
    rim_links = NO_LINKS
    has_rim = (conditions > (0 if bends else FREE)).any()
    if kind == "fem" and not texels.topology.fixed_rim and has_rim:
        places = rim_places(texels, conditions)
        springs = tension_springs(places, texels, tension.ravel())
        _hold_bare_rims(field["fixed"], texels, places)
        if laplace is not None:
            bending, rim_links, plate_springs = plate_bending(
                texels, places, soft, rigidity, material.poisson, laplace
            )
            springs += plate_springs
            stencil.irregular = IrregularLinks.joined(stencil.irregular, rim_links)
        field["stiffness"] += (springs / (density * areas).ravel()).reshape(areas.shape)

    viscosity_stencil = None
    if field["viscosity"].any():
        viscosity_stencil = method.stencil(density * field["viscosity"])
    yields = np.isfinite(field["yield_height"]).any()
    is_uneven = np.ptp(density) > 0
    operator = WaveOperator(
        stencil=stencil,
        mass=density * areas,
        damping=field["damping"],
        stiffness=field["stiffness"],
        viscosity_stencil=viscosity_stencil,
        bending=bending,
        yield_height=field["yield_height"] if yields else None,
        fixed=field["fixed"] if field["fixed"].any() else None,
        density=density if is_uneven else None,
        rim_links=rim_links,
        grip=grip,
    )
    if not material.deep:
        return operator
    return over_fluid(operator, material.deep, method.stencil(np.ones_like(areas)), areas)


def _check_kind(kind: str, rim: Rim) -> None:
    """Raise `SolverError` for an unknown kind of operator, or rims by region for a baseline."""
    if kind not in OPERATORS:
        raise SolverError(
            f"operator must be one of {', '.join(map(repr, OPERATORS))}, got {kind!r}"
        )
    if kind != "fem" and not isinstance(rim, str):
        raise SolverError(
            f"the rim must be one name for the operator {kind!r}, which has no rims by region"
        )


def texel_fields(
    atlas: Atlas, material: Material, fixed_rim: bool
) -> tuple[TexelMesh, dict[str, NDArray]]:
    """Texel mesh with its rim, and the coefficients of a material by name, each [C, n, n].

    A fixed rim has heights of 0; any other is free in the texel mesh.
    """
    field = {name: material.texels(name, atlas.areas.shape) for name in (*LIMITS, "fixed")}
    texels = atlas.texels
    field["fixed"] = field["fixed"] | texels.topology.still[:, None, None]
    if fixed_rim:
        texels = texels.with_fixed_rim()
        field["fixed"] |= texels.bare_rim
    # neighbours do not drag a rigid texel along
    moves = (field["speed"] > 0) | (field["stiffness"] > 0) | (field["bending"] > 0)
    if moves.any():
        field["viscosity"] *= moves
    return texels, field


def source_grip(*pulls: Floats) -> Floats | None:
    """Share of a source that sets each texel in motion, [C, n, n]; None where it is 1 everywhere.

    `pulls` are the coefficients of one kind each that pull a texel back, each [C, n, n].

    A texel without a pull is rigid. One with next to none would sink ever deeper under a load: as
    the strongest pull on a texel fades, against the greatest of its kind on the surface, so does
    the grip of sources. The deflection under a load then stays in proportion to the deflection
    elsewhere.
    """
    shares = [pull / pull.max() for pull in pulls if pull.any()]
    strongest = np.max(shares, axis=0, initial=0.0)
    if not strongest.any() or strongest.min() >= _FAINT_PULL:
        return None
    return np.minimum(1.0, strongest / _FAINT_PULL)


def _hold_bare_rims(fixed: NDArray, texels: TexelMesh, places: RimPlaces) -> None:
    """Mark in `fixed` [C, n, n] the texels in whose centres a rim runs that is not free."""
    held = places.texels[places.conditions != FREE]
    fixed.reshape(-1)[held] |= texels.bare_rim.reshape(-1)[held]
