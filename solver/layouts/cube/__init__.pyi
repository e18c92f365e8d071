from .atlas import (
    CubeChartMap as CubeChartMap,
    SphereAtlas as SphereAtlas,
    atlas_from_sphere_map as atlas_from_sphere_map,
    cast_rays as cast_rays,
    sphere_atlas as sphere_atlas,
    sphere_directions as sphere_directions,
)
from .convention import (
    CHART_NORMALS as CHART_NORMALS,
    CHART_U as CHART_U,
    CHART_V as CHART_V,
    check_memory as check_memory,
    check_resolution as check_resolution,
    cube_chart_points as cube_chart_points,
    cube_topology as cube_topology,
    texel_directions as texel_directions,
)
