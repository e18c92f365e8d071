"""Waves too high or too steep for the object that carries them are reported once a target, with what would do.

Heights are compared with the local radius, slopes with 1.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import RippleWarning
from ripple_sim.solver import Atlas, Material, WaveSolver
from ripple_sim.solver.kernel import Floats32
from ripple_sim.solver.texels.thickness import half_thickness

from .model import CoupledModel
from .suited import Extent, bearing_density

# The height allowed over the local radius.
HIGH = 0.25

# Of the surface, what is counted as the thinnest part is beyond this share.
_THINNEST = 0.99

_ROWS = 4


class Scales(NamedTuple):
    """What heights are compared with; fields are [C, n, n].

    Attributes
    ----------
    per_limit
        1 over the greatest height allowed [1/m].
    per_row, per_column
        1 over the distance to the next texel in the next row and column [1/m]; 0 beyond the chart.
    share
        Of the surface's area.
    per_thinnest : float
        1 over the greatest height allowed where the object is thinnest [1/m].
    calm : float
        Waves that are no higher are neither too high nor too steep anywhere [m].
    """

    per_limit: Floats32
    per_row: Floats32
    per_column: Floats32
    share: Floats32
    per_thinnest: float
    calm: float


def scales_of(atlas: Atlas) -> Scales:
    """What the heights on an atlas are compared with."""
    fields = np.zeros((4, *atlas.areas.shape))
    fields[0] = 1 / (HIGH * half_thickness(atlas))
    for axis in (1, 2):
        spacing = np.linalg.norm(np.diff(atlas.positions, axis=axis), axis=-1)
        inner = (slice(None),) * axis + (slice(None, -1),)
        # needles, on which a slope means little
        fields[axis][inner] = 1 / np.maximum(spacing, 0.5 * np.median(spacing))
    fields[3] = atlas.areas / atlas.areas.sum()
    thinnest = float(np.quantile(fields[0], _THINNEST))
    # no slope can reach 1 where neighbours differ by twice this height at most
    calm = min(1 / fields[0].max(), 1 / (8**0.5 * fields[1:3].max()))
    per_limit, per_row, per_column, share = fields.astype(np.float32)
    return Scales(per_limit, per_row, per_column, share, thinnest, float(calm))


def steep_area(height: Floats32, scales: Scales) -> float:
    """Share of the surface that is steeper than 1, seen on every fourth row."""
    here, below, beside = np.s_[:, :-1:_ROWS, :-1], np.s_[:, 1::_ROWS, :-1], np.s_[:, :-1:_ROWS, 1:]
    down = (height[below] - height[here]) * scales.per_row[here]
    right = (height[beside] - height[here]) * scales.per_column[here]
    share = scales.share[here].astype(np.float64)
    return float(share[down**2 + right**2 > 1].sum() / share.sum())


def slope_of_share(height: NDArray[np.float32], scales: Scales, share: float) -> float:
    """The slope that a share of the surface exceeds."""
    down = np.diff(height, axis=1, append=0) * scales.per_row
    right = np.diff(height, axis=2, append=0) * scales.per_column
    slope = np.hypot(down, right).ravel()
    order = np.argsort(-slope)
    return slope[order[np.searchsorted(np.cumsum(scales.share.ravel()[order]), share)]]


# Slopes beyond 1 are reported if more than this share of the surface has them: a pit under a hard body is steep, but
# small.
_STEEP_AREA = 0.01

# The crests of all steps, and the slopes of one, are looked at once in so many steps. They are read back from a GPU for
# that, which lets it run dry.
_EVERY = {"cpu": 16, "gl": 128}

# A wave that is too high is followed for so many looks, or until it falls again, so that the advice is based on its
# crest.
_FOLLOWED = 4

# The density that is advised is this much more than the least for what was seen, and for a wave of this share of its
# height that has spread to where the object is thinnest.
_MARGIN, _SPREAD = 2.0, 0.3

# What a material is printed with; the others change no wave.
_PRINTED = tuple(each for each in dataclasses.fields(Material) if isinstance(each.default, float | bool))


class AmplitudeCheck:
    """Compares the heights of all targets with their local radii (`half_thickness`), and their slopes with 1.

    Parameters
    ----------
    coupled : CoupledModel
    waves : mapping of int to WaveSolver
        By geom; see `waves_changed`.
    """

    def __init__(self, coupled: CoupledModel, waves: Mapping[int, WaveSolver]) -> None:
        self._coupled = coupled
        self._watched = {geom: _Watch(each) for geom, each in waves.items()}
        self._steps = 0

    def __call__(self) -> None:
        """Look at the heights, if it is time to. Call it after each step of the waves."""
        for geom, watch in list(self._watched.items()):
            if self._steps % _EVERY[watch.waves.backend] == 0 and watch.look():
                self._warn(geom)
        self._steps += 1

    def ignore(self, geom: int) -> None:
        """Give no warning of a geom."""
        self._watched.pop(geom, None)

    def waves_changed(self, geom: int, waves: WaveSolver) -> None:
        """Go on with the new waves of a geom."""
        if geom in self._watched:
            watch = self._watched[geom]
            watch.look()  # at the old ones, a last time
            watch.waves = waves
            waves.crests()

    def flush(self) -> None:
        """Look at the heights a last time, and warn of all that has been seen: the waves are about to end."""
        for geom, watch in list(self._watched.items()):
            watch.look()
            if watch.excess > 1:
                self._warn(geom)

    def _warn(self, geom: int) -> None:
        watch = self._watched.pop(geom)
        warnings.warn(
            f"the waves on geom {self._coupled.names[geom]!r} are {watch.what}; pictures show them limited. "
            + self._advice(geom, watch.waves, _MARGIN * watch.needed),
            RippleWarning,
            stacklevel=5,
        )

    def _advice(self, geom: int, waves: WaveSolver, factor: float) -> str:
        """A material that would do: the same with a density that is so many times as high, or higher."""
        material = waves.material
        given = {each.name: getattr(material, each.name) for each in _PRINTED}
        if any(np.ndim(value) for value in given.values()):
            target = repr(self._coupled.names[geom])
            density = f"{_rounded_up(factor):g} * ripples[{target}].material.density"
            return f"This would do: ripples.change_material({target}, density={density})"
        # what was seen may be the first of many hits
        bearing = bearing_density(self._coupled, geom, Extent.of(waves.rest.mesh), material)
        given["density"] = _rounded_up(max(factor * given["density"], bearing))
        pairs = [
            (each.name, repr(float(f"{given[each.name]:.4g}")))
            for each in _PRINTED
            if given[each.name] != each.default or each.name == "density"
        ]
        python, toml = (", ".join(f"{name}{sign}{value}" for name, value in pairs) for sign in ("=", " = "))
        return f"This would do: Material({python}), in a scene file material = {{{toml}}}"


class _Watch:
    """One target's waves.

    Attributes
    ----------
    waves : WaveSolver
    excess : float
        The most, over what is allowed, of heights and slopes.
    needed : float
        By how much waves would have to be lower.
    what : str
        What was too large, how large, and where.
    """

    def __init__(self, waves: WaveSolver) -> None:
        self.waves = waves
        # lower waves are right anywhere, or too small to matter
        self._calm = 1e-3 * float(np.ptp(waves.rest.mesh.V, axis=0).max())
        self._scales: Scales | None = None
        self.excess, self.needed, self.what = 0.0, 0.0, ""
        self._looks = 0

    def look(self) -> bool:
        """Whether the waves are too high or too steep, and it is time to say so."""
        excess = 0.0
        crests = self.waves.crests()
        if float(crests.max()) > self._calm:
            excess = self._measure(crests, self.waves.height)
        if self.excess > 1:
            self._looks += 1
        return self.excess > 1 and (excess < self.excess or self._looks >= _FOLLOWED)

    def _measure(self, crests: NDArray[np.float32], height: NDArray[np.float32]) -> float:
        if self._scales is None:
            self._scales = scales_of(self.waves.rest)
            self._calm = self._scales.calm
        scales = self._scales
        # the greatest crest over what is allowed there
        share = (crests * scales.per_limit).reshape(-1)
        texel = int(share.argmax())
        high = float(share[texel])
        steep_share = steep_area(height, scales)
        excess, what = high, ""
        if steep_share > _STEEP_AREA:
            steep = float(slope_of_share(height, scales, _STEEP_AREA))
            excess, what = max(excess, steep), f"too steep: a slope of {steep:.2g} or more on {steep_share:.1%} of it"
        if excess > max(self.excess, 1.0):
            if high == excess:
                where = ", ".join(f"{x:.3g}" for x in self.waves.rest.positions.reshape(-1, 3)[texel])
                radius = 1 / (HIGH * float(scales.per_limit.reshape(-1)[texel]))
                here = float(crests.reshape(-1)[texel])
                what = f"too high: {here:.2g} m at ({where}) m, where the object's radius is {radius:.2g} m"
            self.what = what
        self.excess = max(self.excess, excess)
        spread = _SPREAD * float(crests.max()) * scales.per_thinnest
        self.needed = max(self.needed, excess, spread)
        return excess


def _rounded_up(value: float) -> float:
    """To two digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step - 1e-9) * step
