"""Warnings about waves that are too high or too steep for their object.

Heights are compared with the local radius, slopes with 1. There is one warning for each target; it
names a material that avoids such waves.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
import math
from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ripple_sim.solver import Atlas, Material, WaveSolver
from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Floats32, Ints
from ripple_sim.solver.texels.thickness import half_thickness

from .ids import GeomId, TargetId
from .model import CoupledModel
from .suited import Extent, bearing_density

# Greatest allowed height over the local radius.
_ALLOWED_HEIGHT = 0.25

# Greatest allowed depth of a dent under a body, over the greatest allowed height: the body hides
# the dent, and the ring that leaves the dent is lower.
_DENT_FACTOR = 3.0

# A texel lies under a body for so many checks after a body has pressed a texel within the radius of
# its footprint.
_DENT_LOOKS = 3

# Share of the texels for the limit "where the object is thinnest": the rest may be thinner.
_THINNEST_SHARE = 0.99

# Slopes are measured on one row of so many.
_ROW_STRIDE = 4

# Slopes above 1 are reported if they are on more than this share of the surface: a pit under a
# hard body is steep, but small. Where forces are eased, so are heights: the rims of a robot's cover
# are thinner than any ring that can be seen.
_MIN_AREA = 0.01

# Steps between two checks of the slopes and of the crests of all steps so far, by backend. A check
# reads them back from a GPU, which is idle meanwhile.
_LOOK_INTERVAL = {"cpu": 16, "gl": 128}

# A wave that is too high is followed for this many checks, or until it falls again, so that the
# advice is based on its crest.
_FOLLOWED_LOOKS = 4

# Advised density over the least density for the waves so far.
_DENSITY_MARGIN = 2.0

# The advised density also suffices for a wave of this share of the crest where the object is
# thinnest, since waves spread.
_SPREAD_SHARE = 0.3

# Coefficients of a material that the advice prints; the others change no wave.
_PRINTED_FIELDS = tuple(
    field for field in dataclasses.fields(Material) if isinstance(field.default, float | bool)
)


def scales_of(atlas: Atlas) -> tuple[Floats32, float, float]:
    """The lengths on an atlas that heights are compared with.

    Returns
    -------
    fields : float32 [4, C, n, n]
        1 over the greatest height allowed [1/m]; 1 over the distance to the next texel in the next
        row and column [1/m], 0 beyond the chart; share of the surface's area.
    per_thinnest : float
        1 over the greatest height allowed where the object is thinnest [1/m].
    calm : float
        Waves up to this height are neither too high nor too steep anywhere [m].
    """
    fields = np.zeros((4, *atlas.areas.shape))
    fields[0] = 1 / (_ALLOWED_HEIGHT * half_thickness(atlas))
    for axis in (1, 2):
        spacing = np.linalg.norm(np.diff(atlas.positions, axis=axis), axis=-1)
        inner = (slice(None),) * axis + (slice(None, -1),)
        # at least half the median: on needles a slope means little
        fields[axis][inner] = 1 / np.maximum(spacing, 0.5 * np.median(spacing))
    fields[3] = atlas.areas / atlas.areas.sum()
    thinnest = float(np.quantile(fields[0], _THINNEST_SHARE))
    # no slope can reach 1 where neighbours differ by twice this height at most
    calm = min(1 / fields[0].max(), 1 / (8**0.5 * fields[1:3].max()))
    return fields.astype(np.float32), thinnest, float(calm)


def steep_area(height: Floats32, per_row: Floats32, per_column: Floats32, share: Floats32) -> float:
    """Share of the surface that is steeper than 1, seen on every fourth row."""
    texel = np.s_[:, :-1:_ROW_STRIDE, :-1]
    texel_below = np.s_[:, 1::_ROW_STRIDE, :-1]
    texel_right = np.s_[:, :-1:_ROW_STRIDE, 1:]
    slope_down = (height[texel_below] - height[texel]) * per_row[texel]
    slope_right = (height[texel_right] - height[texel]) * per_column[texel]
    shares = share[texel].astype(np.float64)
    return float(shares[slope_down**2 + slope_right**2 > 1].sum() / shares.sum())


class AmplitudeCheck:
    """Warns of waves that are too high or too steep.

    Heights are compared with the local radius (`half_thickness`), slopes with 1. Waves are judged
    by their rings: dents under bodies may be deeper.

    Parameters
    ----------
    coupled : CoupledModel
    waves : mapping of GeomId to WaveSolver
        By target; see `waves_changed`.
    eased : collection of TargetId
        Targets on which forces are eased at present, see `Easing`.
    """

    def __init__(
        self,
        coupled: CoupledModel,
        waves: Mapping[GeomId, WaveSolver],
        eased: Collection[TargetId] = (),
    ) -> None:
        self._coupled = coupled
        self._eased = eased
        self._watched = {geom: _WatchedTarget(solver) for geom, solver in waves.items()}
        self._steps = 0

    def __call__(self) -> None:
        """Check the heights if a check is due. Call it after each step of the waves."""
        for geom, watch in list(self._watched.items()):
            is_due = self._steps % _LOOK_INTERVAL[watch.waves.backend] == 0
            if is_due and watch.look(geom in self._eased):
                self._warn(geom)
        self._steps += 1

    def note_load(self, target: TargetId, texels: Ints) -> None:
        """Note the texels that bodies press in this step, flat indices [k]."""
        if target in self._watched:
            self._watched[GeomId(target)].note_load(texels)

    def ignore(self, geom: GeomId) -> None:
        """Turn the warning about a geom off."""
        self._watched.pop(geom, None)

    def watches(self, geom: GeomId) -> bool:
        """Whether a warning about a geom may still come."""
        return geom in self._watched

    def waves_changed(self, geom: GeomId, waves: WaveSolver) -> None:
        """Continue with the new waves of a geom."""
        if geom in self._watched:
            watch = self._watched[geom]
            watch.look(geom in self._eased)  # a last check of the old waves
            watch.waves = waves
            waves.crests()

    def flush(self) -> None:
        """Check the heights a last time before the waves end, and give pending warnings."""
        for geom, watch in list(self._watched.items()):
            watch.look(geom in self._eased)
            if watch.excess > 1:
                self._warn(geom)

    def _warn(self, geom: GeomId) -> None:
        """Warn of the waves on a geom, and stop to watch it."""
        watch = self._watched.pop(geom)
        target = self._coupled.names[geom]
        advice = self._advice(geom, watch.waves, _DENSITY_MARGIN * watch.needed)
        warn_caller(
            f"the waves on geom {target!r} are {watch.fault}; pictures show them limited. {advice}"
        )

    def _advice(self, geom: GeomId, waves: WaveSolver, factor: float) -> str:
        """Advice: a material whose density is higher by at least a factor."""
        material = waves.material
        values = {field.name: getattr(material, field.name) for field in _PRINTED_FIELDS}
        if any(np.ndim(value) for value in values.values()):
            target = repr(self._coupled.names[geom])
            density = f"{_rounded_up(factor):g} * ripples[{target}].material.density"
            return f"This would do: ripples.change_material({target}, density={density})"
        # the hits so far may be the first of many
        bearing = bearing_density(self._coupled, geom, Extent.of(waves.rest.mesh), material)
        values["density"] = _rounded_up(max(factor * values["density"], bearing))
        pairs = []
        for field in _PRINTED_FIELDS:
            value = values[field.name]
            if value != field.default or field.name == "density":
                pairs.append((field.name, repr(float(f"{value:.4g}"))))
        python = ", ".join(f"{name}={value}" for name, value in pairs)
        toml = ", ".join(f"{name} = {value}" for name, value in pairs)
        return f"This would do: Material({python}), in a scene file material = {{{toml}}}"


class _WatchedTarget:
    """The waves of one target, and the result of the checks so far.

    Attributes
    ----------
    waves : WaveSolver
    excess : float
        Greatest height and slope over the allowed ones.
    needed : float
        Factor by which waves would have to be lower.
    fault : str
        Words for the warning: whether the waves are too high or too steep, by how much, and where.
    """

    def __init__(self, waves: WaveSolver) -> None:
        self.waves = waves
        self.excess = 0.0
        self.needed = 0.0
        self.fault = ""
        # checks since the waves were first too high or too steep
        self._looks = 0
        # waves up to this height need no check [m]
        self._calm = 1e-3 * float(np.ptp(waves.rest.mesh.V, axis=0).max())
        # see `scales_of`; computed when waves are first higher than `_calm`
        self._scales: tuple[Floats32, float] | None = None
        # texels that were pressed in each step since the last look, and before the latest looks
        self._loaded: list[Ints] = []
        self._loaded_before = collections.deque[list[Ints]](maxlen=_DENT_LOOKS - 1)

    def note_load(self, texels: Ints) -> None:
        """Note the texels that bodies press in this step, flat indices [k]."""
        self._loaded.append(texels)

    def look(self, is_eased: bool = False) -> bool:
        """Check the waves; return whether they are too high or too steep, and the warning is due.

        If forces are eased, the height is judged that `_MIN_AREA` of the surface exceeds.
        """
        excess = 0.0
        crests = self.waves.crests()
        if float(crests.max()) > self._calm:
            excess = self._measure(crests, self.waves.height, is_eased)
        self._loaded_before.append(self._loaded)
        self._loaded = []
        if self.excess > 1:
            self._looks += 1
        return self.excess > 1 and (excess < self.excess or self._looks >= _FOLLOWED_LOOKS)

    def _measure(
        self, crests: NDArray[np.float32], height: NDArray[np.float32], is_eased: bool
    ) -> float:
        """Compare heights and slopes with the limits; return the greater excess."""
        if self._scales is None:
            fields, thinnest, self._calm = scales_of(self.waves.rest)
            self._scales = fields, thinnest
        (per_limit, per_row, per_column, share), per_thinnest = self._scales
        rings = self._rings(crests, per_limit)
        # rings over the greatest allowed heights
        height_excesses = (rings * per_limit).reshape(-1)
        texel = int(height_excesses.argmax())
        if is_eased and height_excesses[texel] > 1:
            texel = _exceeded_at(height_excesses, share)
        height_excess = float(height_excesses[texel])
        steep_share = steep_area(height, per_row, per_column, share)
        slope = 0.0
        if steep_share > _MIN_AREA:
            slope = _steepness(height, per_row, per_column, share)
        excess = max(height_excess, slope)
        if excess > max(self.excess, 1.0):
            if height_excess > 1:
                limit = 1 / float(per_limit.reshape(-1)[texel])
                self.fault = self._too_high(texel, float(crests.reshape(-1)[texel]), limit)
            else:
                self.fault = f"too steep: a slope of {slope:.2g} or more on {steep_share:.1%} of it"
        self.excess = max(self.excess, excess)
        spread = _SPREAD_SHARE * float(rings.max()) * per_thinnest
        self.needed = max(self.needed, excess, spread)
        return excess

    def _rings(
        self, crests: NDArray[np.float32], per_limit: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Crests [C, n, n], with dents under bodies made lower, as they may be deeper [m]."""
        # the texels of each load of the latest steps
        loads = list(itertools.chain(*self._loaded_before, self._loaded))
        high = np.flatnonzero(crests * per_limit > 1)
        if not loads or not len(high):
            return crests
        areas = self.waves.rest.areas.reshape(-1)
        positions = self.waves.rest.positions.reshape(-1, 3)
        # of a disc with the area of the largest load [m]
        radius = max(np.sqrt(areas[texels].sum() / np.pi) for texels in loads)
        loaded_places = cKDTree(positions[np.unique(np.concatenate(loads))])
        distances, _ = loaded_places.query(positions[high], distance_upper_bound=radius)
        is_under_body = np.isfinite(distances)
        rings = crests.copy()
        rings.reshape(-1)[high[is_under_body]] /= np.float32(_DENT_FACTOR)
        return rings

    def _too_high(self, texel: int, crest: float, limit: float) -> str:
        """Words for a crest [m] at a texel that is above its limit [m]."""
        position = self.waves.rest.positions.reshape(-1, 3)[texel]
        coordinates = ", ".join(f"{x:.3g}" for x in position)
        radius = limit / _ALLOWED_HEIGHT
        return (
            f"too high: {crest:.2g} m at ({coordinates}) m, where the object's radius is "
            f"{radius:.2g} m"
        )


def _steepness(height: Floats32, per_row: Floats32, per_column: Floats32, share: Floats32) -> float:
    """The slope that `_MIN_AREA` of the surface exceeds."""
    slope_down = np.diff(height, axis=1, append=0) * per_row
    slope_right = np.diff(height, axis=2, append=0) * per_column
    slope = np.hypot(slope_down, slope_right).ravel()
    return float(slope[_exceeded_at(slope, share)])


def _exceeded_at(values: Floats32, share: Floats32) -> int:
    """Flat index of the texel whose value, of values [k], `_MIN_AREA` of the surface exceeds."""
    order = np.argsort(-values)
    area = np.cumsum(share.ravel()[order])
    return int(order[np.searchsorted(area, _MIN_AREA)])


def _rounded_up(value: float) -> float:
    """The value, rounded up to two digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step - 1e-9) * step
