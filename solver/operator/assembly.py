"""From an atlas and a material to the wave operator: finite elements, or a baseline to compare them with.

On a surface that moves masses stay with the texels, and stiffness follows their positions. Regions
of an atlas are held still along their outline, or absorb waves, by what they do to the material.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SolverError
from ..kernel import Floats
from ..texels.atlas import Atlas
from ..texels.distance import depth_in_region
from ..texels.moving import MovedPlaces, MovedStencil
from ..texels.stencil import (
    LINK_ENDS,
    NO_LINKS,
    IrregularLinks,
    Stencil,
    crossing_links,
    link_lengths,
)
from ..texels.texel_mesh import TexelMesh, smoothed, softening
from .coefficients import LIMITS
from .curvatures import Curvatures
from .deep_water import FluidOperator, over_fluid
from .material import Material
from .plate_bending import plate_bending
from .plate_rim import FREE, RIMS, Rim, rim_conditions, rim_places, tension_springs
from .wave_operator import Bending, WaveOperator

OPERATORS = ("fem", "paper", "uncorrected", "dynamic-paint")

# Below this share of the greatest pull on the surface sources lose their grip: where waves run at 3
# % of the speed.
_FAINT = 1e-3

# Where so much of the neighbourhood is held a texel is held wholly: at the outline it is a half.
_WHOLE = 0.8

# Texels that are held by this much and more are clamped.
_CLAMPED = 0.98


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
        "free", "supported", "clamped" or "fixed", see `WaveSolver`. To surfaces that do not bend
        the last three are the same. Rims of a plate that are free, supported or clamped are those
        of `plate_bending`, where it is of kind "fem"; elsewhere, and where it is "fixed", heights
        are 0 at rims that are not free, and so is L h.

    Raises
    ------
    SolverError
        For an unknown kind or rim, rims by region for a baseline, or a material of another
        resolution.
    """
    conditions = rim_conditions(atlas.texels, rim)
    if kind not in OPERATORS:
        raise SolverError(
            f"operator {kind!r} does not exist; valid are {', '.join(map(repr, OPERATORS))}"
        )
    if kind != "fem" and not isinstance(rim, str):
        raise SolverError(
            f"the operator {kind!r} has no rims by region; valid is one name for all of the rim"
        )
    bends = bool(np.any(material.bending))
    texels, field = texel_fields(
        atlas, material, rim == "fixed" or (rim in RIMS[1:] and (not bends or kind != "fem"))
    )
    density = field["density"]
    area = atlas.areas
    if kind == "fem":
        soft = softening(texels)
        assemble = functools.partial(texels.stencil, softening=soft)
    else:
        # these formulas give accelerations without masses: one area for all keeps the units, one
        # density as well
        area = np.full_like(area, area.mean())
        density = np.full_like(density, density.mean())
        assemble = functools.partial(_difference_stencil, texels, kind, area[0, 0, 0])
    grip = source_grip(field["speed"] ** 2, field["stiffness"], field["bending"])
    tension = density * field["speed"] ** 2
    rigidity = density * field["bending"]
    stencil = assemble(tension)
    laplace = assemble(np.ones_like(area)) if bends else None
    bending: Bending | Curvatures | None = (
        None if laplace is None else Bending(laplace, rigidity / area)
    )
    links = NO_LINKS
    if (
        kind == "fem"
        and not texels.topology.fixed_rim
        and (conditions > (0 if bends else FREE)).any()
    ):
        places = rim_places(texels, conditions)
        springs = tension_springs(places, texels, tension.ravel())
        held = places.texels[places.conditions != FREE]
        field["fixed"].reshape(-1)[held] |= texels.bare_rim.reshape(-1)[held]
        if laplace is not None:
            bending, links, beside = plate_bending(
                texels, places, soft, rigidity, material.poisson, laplace
            )
            springs += beside
            stencil.irregular = IrregularLinks.joined(stencil.irregular, links)
        field["stiffness"] += (springs / (density * area).ravel()).reshape(area.shape)
    operator = WaveOperator(
        stencil=stencil,
        mass=density * area,
        damping=field["damping"],
        stiffness=field["stiffness"],
        viscosity_stencil=assemble(density * field["viscosity"])
        if field["viscosity"].any()
        else None,
        bending=bending,
        yield_height=field["yield_height"] if np.isfinite(field["yield_height"]).any() else None,
        fixed=field["fixed"] if field["fixed"].any() else None,
        density=density if np.ptp(density) else None,
        rim_links=links,
        grip=grip,
    )
    return (
        over_fluid(operator, material.deep, assemble(np.ones_like(area)), area)
        if material.deep
        else operator
    )


def texel_fields(
    atlas: Atlas, material: Material, fixed_rim: bool
) -> tuple[TexelMesh, dict[str, NDArray]]:
    """Texel mesh with its rim, fixed or free, and the coefficients of a material at each of its texels, [C, n, n]."""
    field = {name: material.texels(name, atlas.areas.shape) for name in (*LIMITS, "fixed")}
    texels = atlas.texels
    if fixed_rim:
        texels = texels.with_fixed_rim()
        field["fixed"] |= texels.bare_rim
    # rigid texels are not dragged along by their neighbours either
    moves = (field["speed"] > 0) | (field["stiffness"] > 0) | (field["bending"] > 0)
    if moves.any():
        field["viscosity"] *= moves
    return texels, field


def source_grip(*pulls: Floats) -> Floats | None:
    """Share of a source that sets each texel in motion, [C, n, n], by what pulls it back, each [C, n, n]; None: all.

    A texel without a pull is rigid. One with next to none would sink ever deeper under a load: as
    the strongest pull on a texel fades, against the greatest of its kind on the surface, so does
    the grip of sources. The deflection under a load then stays in proportion to that elsewhere.
    """
    strongest = np.max([pull / pull.max() for pull in pulls if pull.any()], axis=0, initial=0.0)
    if not strongest.any() or strongest.min() >= _FAINT:
        return None
    return np.minimum(1.0, strongest / _FAINT)


def _difference_stencil(
    texels: TexelMesh, kind: str, area: float, coefficient: NDArray[np.float64]
) -> Stencil:
    """Link weights area coefficient / distance^2 of the baselines, which know no links beyond the nine points."""
    lengths = link_lengths(texels.topology, texels.halo_positions)
    if kind != "dynamic-paint":
        lengths[:, 2:] = np.inf  # of the diagonals
    if kind == "uncorrected":
        finite = np.isfinite(lengths)
        lengths[finite] = lengths[finite].mean()
    lengths[lengths == 0] = np.inf
    c = texels.topology.with_halo(coefficient)
    weights = area * np.stack([(c[a] + c[b]) / 2 for a, b in LINK_ENDS], axis=1) / lengths**2
    crossing_links(texels.topology).level(weights)
    return Stencil(texels.topology, weights)


class MovingOperator:
    """Makes the operator of a material anew wherever the texels are.

    The mass sigma A of each texel is that at rest, so that its density falls as its area grows, and
    with it tension sigma c^2 and viscous resistance sigma nu. Rates and speeds are the material's
    own, but that c^2 goes with a power of the area, `Material.tightening`; so does the square of a
    plate's frequency with b. A plate with rims of its own bends everywhere as it does at rest.

    Parameters
    ----------
    atlas : Atlas
        At rest.
    operator : WaveOperator
        At rest, of kind "fem".

    Raises
    ------
    SolverError
        If there is deep fluid below.
    """

    def __init__(self, atlas: Atlas, material: Material, operator: WaveOperator) -> None:
        if isinstance(operator, FluidOperator):
            raise SolverError(
                "a surface with deep fluid below cannot move; take a material without `deep`"
            )
        texels, field = texel_fields(atlas, material, operator.topology.fixed_rim)
        self._rest = operator
        self._cells = texels.cells
        soft = softening(texels)
        density = field["density"]
        self._tension = self._cells.coefficient(
            density * field["speed"] ** 2, soft, material.tightening - 1.0
        )
        self._viscosity = self._laplace = None
        self._viscosity_share: float | None = None
        if operator.viscosity_stencil is not None:
            squared = field["speed"] ** 2
            if not material.tightening and squared.all():
                # of tension's stencil, where it is the same share everywhere and at any time
                share = field["viscosity"] / squared
                self._viscosity_share = (
                    float(share.flat[0]) if (share == share.flat[0]).all() else None
                )
            self._viscosity = self._cells.coefficient(density * field["viscosity"], soft, -1.0)
        if isinstance(operator.bending, Bending):
            self._laplace = self._cells.coefficient(np.ones_like(density), soft, 0.0)
        around = np.ascontiguousarray(np.moveaxis(texels.halo_positions, -1, 0))
        self._level = atlas.areas / self._cells.moved(around, self._tension)[1]
        self._areas = atlas.areas

    def at(self, places: MovedPlaces) -> WaveOperator:
        """Operator where the places are."""
        tension = MovedStencil(self._cells, self._tension, places, added=self._rest.rim_links)
        viscosity = None
        bending = self._rest.bending
        if self._viscosity is not None:
            like = None if self._viscosity_share is None else (tension, self._viscosity_share)
            viscosity = MovedStencil(self._cells, self._viscosity, places, like)
        if self._laplace is not None and isinstance(bending, Bending):
            laplace = MovedStencil(self._cells, self._laplace, places)
            # sigma b / A, with sigma = M / A
            bending = Bending(laplace, bending.rigidity * (self._areas / self.areas(laplace)) ** 2)
        return self._rest.moved(tension, viscosity, bending)

    def areas(self, stencil: Stencil) -> Floats:
        """Area of each texel [m^2], [C, n, n], under a stencil of `at`; that at rest under any other."""
        if not isinstance(stencil, MovedStencil):
            return self._areas
        return np.maximum(stencil.areas * self._level, 1e-3 * self._areas)


def absorbing_damping(
    atlas: Atlas,
    region: ArrayLike,
    speed: float,
    reflection: float = 1e-3,
    width: float | None = None,
) -> NDArray[np.float64]:
    """Damping that grows with the square of the depth in a region, so gently that little is reflected.

    A wave that goes through a layer of width w and back loses the factor exp(-integral of zeta /
    c), which for zeta = z (depth / w)^2 is exp(-z w / 3 c). Waves longer than the layer is wide are
    partly reflected whatever the damping (Israeli and Orszag 1981).

    Parameters
    ----------
    atlas : Atlas
    region : bool [C, n, n]
        Where waves are to die.
    speed : float
        Wave speed in the region [m/s].
    reflection : float
        Amplitude that may come back, over that which went in.
    width : float, optional
        Depth from which on the damping grows no more [m]; by default the region's deepest place.

    Returns
    -------
    float64 [C, n, n]
        zeta [1/s] for `Material`, 0 outside the region.

    Raises
    ------
    SolverError
        If the region is not a mask of the atlas, covers nothing or everything, or a number is out
        of range.
    """
    mask = np.asarray(region)
    shape = atlas.areas.shape
    if mask.dtype != bool or mask.shape != shape:
        raise SolverError(
            f"absorbing region has type {mask.dtype} and shape {mask.shape}; valid is bool, {shape}"
        )
    if mask.all() or not mask.any():
        raise SolverError(
            f"absorbing region holds {mask.sum()} of {mask.size} texels; valid is some, but not all"
        )
    if not 0 < reflection < 1:
        raise SolverError(f"reflection is {reflection!r}; valid is a number between 0 and 1")
    if not 0 < speed < np.inf:
        raise SolverError(f"speed is {speed!r} m/s; valid is a finite number greater than 0")
    depth = depth_in_region(atlas.texels, mask)
    if width is None:
        width = float(depth.max())
    if not 0 < width < np.inf:
        raise SolverError(f"width is {width!r} m; valid is a finite number greater than 0")
    return 3 * speed * np.log(1 / reflection) / width * np.minimum(depth / width, 1) ** 2


def hold(atlas: Atlas, material: Material, region: ArrayLike) -> Material:
    """Material that holds a region still: waves reflect from it inverted, as from a clamp, and pushes do not move it.

    A clamp, like a region of speed 0, ends at texels: its rim is a staircase, and the surface is
    torn or kinked along it. Here springs lead up to the clamp, over a few texels about the rim.
    They stiffen with the share of the neighbourhood that is held, so that the height fades out
    along the region's true outline. They take no energy. Waves turn at the outline, within a texel.

    Parameters
    ----------
    atlas : Atlas
    material : Material
        Of the free surface.
    region : bool or float [C, n, n]
        Held share of each texel, from 0 to 1.

    Returns
    -------
    Material
        With springs added to `stiffness`, and the inner part of the region in `fixed`.

    Raises
    ------
    SolverError
        If the region is not a mask of the atlas, or holds shares that are not from 0 to 1.
    """
    share = np.asarray(region, dtype=np.float64)
    if share.shape != atlas.areas.shape:
        raise SolverError(f"held region has shape {share.shape}; valid is {atlas.areas.shape}")
    if not ((share >= 0) & (share <= 1)).all():
        raise SolverError(
            "held region has shares below 0, above 1 or NaN; valid are numbers from 0 to 1"
        )
    share = np.clip(smoothed(atlas.texels.topology, share) / _WHOLE, 0, 1)
    speed, bending, stiffness, fixed = (
        material.texels(name, atlas.areas.shape)
        for name in ("speed", "bending", "stiffness", "fixed")
    )
    # as stiff as what a texel's neighbours have: a wave falls to 1/e within a texel
    springs = share**2 * (speed**2 / atlas.areas + bending / atlas.areas**2)
    return dataclasses.replace(
        material, stiffness=stiffness + springs, fixed=fixed | (share >= _CLAMPED)
    )
