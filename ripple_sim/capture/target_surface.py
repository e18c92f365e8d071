"""What the renderer draws of a target."""

from __future__ import annotations

from ripple_sim.render import Surface
from ripple_sim.render.surfaces.charts import Charts
from ripple_sim.solver import WaveSolver


def surface_of(waves: WaveSolver, look: str, color: tuple[float, float, float] | None = None) -> Surface:
    """Surface to be drawn of a target."""
    atlas = waves.rest
    mesh = atlas.mesh
    return Surface(
        V=mesh.V,
        F=mesh.F,
        charts=Charts.of(atlas),
        look=look,
        color=color,
        uv=mesh.uv if mesh.corner_uv is None else mesh.corner_uv,
    )
