from .atlas import Atlas as Atlas, check_points as check_points
from .atlas_file import (
    ADVICE as ADVICE,
    FORMAT as FORMAT,
    check_atlas_place as check_atlas_place,
    read_arrays as read_arrays,
    read_atlas_file as read_atlas_file,
    write_arrays as write_arrays,
    write_atlas_file as write_atlas_file,
)
from .barycentrics import barycentrics_at as barycentrics_at, barycentrics_in as barycentrics_in
from .cells import (
    EVENNESS as EVENNESS,
    MAX_HOURGLASS_SHARE as MAX_HOURGLASS_SHARE,
    MIN_AREA as MIN_AREA,
    PER_HOURGLASS as PER_HOURGLASS,
    PER_TINY as PER_TINY,
    TINY as TINY,
    polygons as polygons,
    quad as quad,
)
from .chart_map import (
    ChartMap as ChartMap,
    LinearChartMap as LinearChartMap,
    Parts as Parts,
    texture_coordinates as texture_coordinates,
    uncut as uncut,
)
from .chart_page import ChartPage as ChartPage
from .detours import link_detours as link_detours
from .distance import (
    clean as clean,
    depth_in_region as depth_in_region,
    distance_scratch as distance_scratch,
    distance_to as distance_to,
    march as march,
    seeded as seeded,
)
from .gluing import glue as glue
from .halo import (
    fill_halo as fill_halo,
    sampling_matrix as sampling_matrix,
    with_filled_halo as with_filled_halo,
)
from .maps import texture_map as texture_map, vertex_map as vertex_map
from .moving import (
    MovedPlaces as MovedPlaces,
    MovedStencil as MovedStencil,
    SurfaceRide as SurfaceRide,
    interpolate as interpolate,
)
from .parts_mesh import PartsMesh as PartsMesh, parts_mesh as parts_mesh
from .quad_pass import MIN_AREA_RATIO as MIN_AREA_RATIO
from .smoothing import smoothed as smoothed
from .stencil import (
    LINK_ENDS as LINK_ENDS,
    NO_LINKS as NO_LINKS,
    IrregularLinks as IrregularLinks,
    Stencil as Stencil,
    crossing_links as crossing_links,
    largest_eigenvalue as largest_eigenvalue,
    link_exists as link_exists,
    link_lengths as link_lengths,
    missing_links as missing_links,
    stiffness_matrix as stiffness_matrix,
)
from .stiffness import TexelCells as TexelCells
from .stretch import QUANTILES as QUANTILES, stretch_summary as stretch_summary
from .texel_mesh import TexelGrid as TexelGrid, TexelMesh as TexelMesh
from .texel_quality import folded_texels as folded_texels, texel_quality as texel_quality
from .thickness import (
    MIN_MEDIAL_RADIUS as MIN_MEDIAL_RADIUS,
    half_thickness as half_thickness,
    half_thickness_at as half_thickness_at,
    medial_radius as medial_radius,
    thickness_map as thickness_map,
)
from .topology import TexelTopology as TexelTopology
