"""The solver's law, texel by texel, for a page that solves the waves of a target.

html/law.js reads what is written here and states the law.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, hstack, triu

from ripple_sim.solver import WaveSolver
from ripple_sim.solver.operator.wave_operator import WaveOperator
from ripple_sim.solver.texels.stencil import Stencil, rim_ties, stiffness_matrix
from ripple_sim.solver.texels.thickness import medial_radius
from ripple_sim.solver.waves.height_map import FREE_SHARE, MAX_SHARE, halo_sources

from .page_coding import ScaledField, differences, packed, planes, scaled_field

# Weights of viscosity and tension are proportional if their ratio varies by less than this share.
_SAME_RATIO = 1e-6


def replay_reason(waves: WaveSolver) -> str:
    """Why a page cannot solve the waves of a surface, in words after its name; "" if it can."""
    operator = waves.operator
    if waves.material.deep:
        return "has deep water below it"
    if operator.yield_height is not None:
        return "keeps dents"
    if waves.vertices is not None:
        return "moves by itself"
    return ""


class _LawContent:
    """The law's numbers as they are written: a description, and bytes in the order of reading."""

    def __init__(self) -> None:
        self.meta: dict[str, Any] = {}
        self._content: list[bytes] = []

    def field(self, name: str, values: NDArray) -> None:
        """Add a field of numbers that may have small errors."""
        coded: ScaledField = scaled_field(values)
        self.meta[name] = coded.meta
        self._content.append(coded.content)

    def exact(self, values: NDArray) -> None:
        """Add whole numbers, or floats with all their digits."""
        self._content.append(planes(values))

    def text(self) -> str:
        """All of it as JSON."""
        return json.dumps({**self.meta, "arrays": packed(b"".join(self._content))})


def wave_law(
    waves: WaveSolver,
    *,
    limited: bool,
    points: tuple[NDArray[np.int32], NDArray[np.float32]],
    pulse: float,
) -> str:
    """The law of a surface's waves, as JSON.

    Parameters
    ----------
    waves : WaveSolver
        For which `replay_reason` finds none.
    limited : bool
        Whether heights that are too large for the object are drawn smaller.
    points : (int32 [k, 3], float32 [k, 2])
        Where the page's vertices take their heights, see `spline_samples`.
    pulse : float
        A poke's impulse where the run has no hit [N s].
    """
    operator = waves.operator
    content = _LawContent()
    shape = operator.mass.shape
    links, springs, viscous = operator.rates
    movable = operator.stiffness[operator.movable]
    content.meta |= {
        "charts": shape[0],
        "resolution": shape[1],
        "rates": {
            "links": links,
            "springs": springs,
            "viscous": viscous,
            "spring": max(float(np.median(movable)), 0.0),
        },
        "free": FREE_SHARE,
        "most": MAX_SHARE,
        "pulse": pulse,
    }
    _add_links(content, operator)
    content.field("mass", operator.mass)
    content.field("damping", operator.damping)
    content.field("stiffness", operator.stiffness)
    content.field("moving", operator.free.astype(float))
    content.field("share", operator.source_share)
    content.field("inverseDensity", operator.inverse_density)
    _add_parts(content, waves)
    _add_places(content, waves)
    _add_samples(content, waves, points)
    radius = medial_radius(waves.rest) if limited else np.full(shape, np.inf)
    content.meta["limited"] = limited
    if limited:
        content.field("radius", radius)
    _add_state(content, waves)
    return content.text()


def _add_links(content: _LawContent, operator: WaveOperator) -> None:
    """The links of tension and bending, and of viscosity: once each, with one weight for both ends.

    A weight that is used for both ends keeps the operator symmetric, however coarse its digits.
    """
    elastic = _upper_links(operator.stencil)
    viscous = None
    ratio = 0.0
    if operator.viscosity_stencil is not None:
        viscous = _upper_links(operator.viscosity_stencil)
        ratio = _ratio(viscous, elastic)
    sets = [("elastic", elastic, False)]
    if operator.bending is not None:
        # a plate's force is a small difference of large numbers: it needs all digits
        sets.append(("bending", _upper(operator.bending.stiffness), True))
    if viscous is not None and not ratio:
        sets.append(("viscous", viscous, False))
    content.meta["viscosityRatio"] = ratio
    content.meta["links"] = []
    for kind, matrix, exact in sets:
        counts = np.diff(matrix.indptr)
        rows = np.repeat(np.arange(len(counts)), counts)
        content.exact(counts.astype("<u2"))
        content.exact((matrix.indices - rows).astype("<u4"))
        if exact:
            content.exact(matrix.data.astype("<f4"))
            weights: Any = "exact"
        else:
            content.field("weights", matrix.data)
            weights = content.meta.pop("weights")
        content.meta["links"].append({"kind": kind, "count": matrix.nnz, "weights": weights})


def _upper_links(stencil: Stencil) -> csr_array:
    """Weights of a stencil's links by their two texels, the lesser one first, [T, T + 1].

    Texel T stands for what a fixed rim holds at height 0.
    """
    matrix = _upper(stiffness_matrix(stencil))
    topology = stencil.topology
    if not topology.fixed_rim:
        return matrix
    tied, places = rim_ties(topology)
    ties = np.bincount(tied, stencil.weights.reshape(-1)[places], topology.texel_count)
    column = csr_array(ties[:, None])
    joined = csr_array(hstack([matrix[:, :-1], column]))
    joined.eliminate_zeros()
    return joined


def _upper(matrix: csr_array) -> csr_array:
    """Weights of the links of a stiffness matrix, [T, T + 1]."""
    upper = csr_array(-triu(matrix, k=1, format="csr"))
    upper.sum_duplicates()
    upper.eliminate_zeros()
    upper.resize((matrix.shape[0], matrix.shape[0] + 1))
    upper.sort_indices()
    return upper


def _ratio(viscous: csr_array, elastic: csr_array) -> float:
    """Ratio of the weights of viscosity and tension [s]; 0 if it is not the same for all links."""
    same_links = np.array_equal(viscous.indptr, elastic.indptr) and np.array_equal(
        viscous.indices, elastic.indices
    )
    if not same_links or not elastic.nnz:
        return 0.0
    ratios = viscous.data / elastic.data
    ratio = float(np.median(ratios))
    return ratio if np.abs(ratios / ratio - 1).max() < _SAME_RATIO else 0.0


def _add_parts(content: _LawContent, waves: WaveSolver) -> None:
    """The part of each texel, and which parts keep their volume."""
    operator = waves.operator
    content.meta["kept"] = waves.kept_parts.tolist()
    content.meta["balanced"] = waves.balanced_parts.tolist()
    content.meta["parted"] = operator.parts is not None
    if operator.parts is not None:
        content.exact(operator.parts.ravel().astype("<u2"))


def _add_places(content: _LawContent, waves: WaveSolver) -> None:
    """Places of the texels, in 16 bits each."""
    positions = waves.rest.positions.reshape(-1, 3)
    low = positions.min(axis=0)
    size = float(np.ptp(positions, axis=0).max())
    content.meta["low"] = low.tolist()
    content.meta["size"] = size
    steps = np.rint((positions - low) / size * 65535).astype(np.int64)
    content.exact(differences(steps))


def _add_samples(
    content: _LawContent,
    waves: WaveSolver,
    points: tuple[NDArray[np.int32], NDArray[np.float32]],
) -> None:
    """The heights about each chart, and the places where the page's vertices take theirs."""
    topology = waves.operator.topology
    width = topology.shape[1] + 2
    border = np.ones((width, width), bool)
    border[1:-1, 1:-1] = False
    sources, means, ends = halo_sources(topology)
    content.exact(sources[:, border].astype("<i4"))
    content.meta["means"] = means.tolist()
    content.meta["ends"] = ends.tolist()
    texels, offsets = points
    content.meta["points"] = len(texels)
    first = (texels[:, 0] * width + texels[:, 1]) * width + texels[:, 2]
    content.exact(first.astype("<u4"))
    content.exact(np.rint(offsets * 32767).clip(-32767, 32767).astype("<i2"))


def _add_state(content: _LawContent, waves: WaveSolver) -> None:
    """Height and velocity at the beginning, where there are any."""
    height = waves.height
    velocity = waves.velocity
    content.field("height", height)
    content.field("velocity", velocity)
