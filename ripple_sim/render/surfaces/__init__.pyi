from .adaptive import AdaptiveTessellation as AdaptiveTessellation
from .displacement import Displacement as Displacement
from .moving import MovingOcclusion as MovingOcclusion, MovingVertices as MovingVertices
from .spline import (
    spline_heights as spline_heights,
    spline_samples as spline_samples,
    spline_weights as spline_weights,
)
from .surface import (
    Charts as Charts,
    Surface as Surface,
    shared_places as shared_places,
    split_at_charts as split_at_charts,
    target_color as target_color,
)
from .tessellation import (
    BAKED as BAKED,
    COORDINATES as COORDINATES,
    DIRECTION as DIRECTION,
    NORMAL as NORMAL,
    POSITION as POSITION,
    UV as UV,
    coarse_mesh as coarse_mesh,
    midpoints as midpoints,
    tessellate as tessellate,
    welded as welded,
)
from .vertices import (
    SurfaceVertices as SurfaceVertices,
    mapped_coordinates as mapped_coordinates,
    memory_order as memory_order,
    morton_order as morton_order,
    rounded_parts as rounded_parts,
    surface_vertices as surface_vertices,
    tessellated as tessellated,
)
