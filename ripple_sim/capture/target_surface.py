"""What the renderer draws of a target."""

from __future__ import annotations

from ripple_sim.render import Surface
from ripple_sim.render.surfaces.charts import Charts
from ripple_sim.solver import SphereAtlas, WaveSolver, sphere_atlas

# Resolution of the sphere that is drawn: the mesh of its atlas has a vertex a texel, more than pictures need.
_SPHERE = 32


def surface_of(waves: WaveSolver, look: str, color: tuple[float, float, float] | None = None) -> Surface:
    """Surface to be drawn of a target."""
    atlas = drawn = waves.rest
    if isinstance(atlas, SphereAtlas) and atlas.resolution > _SPHERE:
        drawn = sphere_atlas(atlas.radius, _SPHERE)
    mesh = drawn.mesh
    return Surface(
        V=mesh.V,
        F=mesh.F,
        charts=Charts(drawn.chart_map, atlas.texels.shape),
        look=look,
        color=color,
        uv=mesh.uv if mesh.corner_uv is None else mesh.corner_uv,
        moving=None if drawn is atlas else (atlas.mesh.V, atlas.mesh.F),
    )
