"""Times of arrival by every formula and on both sphere maps.

Each formula is measured as it stands, at 1 m/s. Dynamic Paint's is measured once more with its speed calibrated, as
Blender's users do it by eye: one factor for the whole target, by which the median arrival is right. Nobody else gets
that. The paper's formula is also measured on the map that the paper takes, the conformal one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, RippleError, build_atlas
from ripple_sim.solver.operator.assembly import OPERATORS

from .arrival import Arrival, arrival
from .sources import spread_sources

CALIBRATED = "dynamic-paint, calibrated"
CONFORMAL = "paper, conformal map"

# Errors by their names in `ArrivalError`, and "speed factor" where the speed was calibrated; None where the sphere map
# was refused.
Row = dict[str, float] | None


def arrivals(meshes: dict[str, Mesh], resolution: int = 96, sources: int = 3) -> dict[str, dict[str, Row]]:
    """Errors of arrival on the project's own test body and on given meshes, mean over the sources."""
    bodies = {"limbed": Mesh.from_arrays(*limbed())} | meshes
    return {name: _rows(mesh, resolution, sources) for name, mesh in bodies.items()}


def speed_factor(arrivals: Sequence[Arrival]) -> float:
    """Factor on the wave speed by which the median front over the whole target arrives in time."""
    return float(np.nanmedian(np.concatenate([each.front for each in arrivals])))


def _rows(mesh: Mesh, resolution: int, sources: int) -> dict[str, Row]:
    atlas = build_atlas(mesh, resolution)
    vertices = spread_sources(atlas, sources)
    measured = {operator: _measure(atlas, vertices, operator) for operator in OPERATORS}
    rows: dict[str, Row] = {operator: mean_error(each) for operator, each in measured.items()}
    factor = speed_factor(measured["dynamic-paint"])
    calibrated = mean_error([each.at_speed(factor) for each in measured["dynamic-paint"]])
    rows[CALIBRATED] = {**calibrated, "speed factor": factor}
    rows[CONFORMAL] = None
    try:
        conformal = build_atlas(mesh, resolution, method="conformal", layout="cube")
    except RippleError:
        return rows
    rows[CONFORMAL] = mean_error(_measure(conformal, vertices, "paper"))
    return rows


def _measure(atlas: Atlas, vertices: Sequence[int], operator: str) -> list[Arrival]:
    return [arrival(atlas, vertex, operator) for vertex in vertices]


def mean_error(arrivals: Sequence[Arrival]) -> dict[str, float]:
    """Mean of the errors over several sources, by their names in `ArrivalError`."""
    rows = [dataclasses.asdict(each.error()) for each in arrivals]
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}
