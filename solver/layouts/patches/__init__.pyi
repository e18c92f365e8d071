from .atlas import (
    PatchChartMap as PatchChartMap,
    atlas_from_patch_map as atlas_from_patch_map,
    cells_for as cells_for,
    patch_atlas as patch_atlas,
)
from .cells import (
    BorderedCells as BorderedCells,
    Metric as Metric,
    cell_sizes as cell_sizes,
    centred_cells as centred_cells,
    spread_seeds as spread_seeds,
)
from .collapse import without_cuts as without_cuts
from .disks import disk_cells as disk_cells, signed_areas as signed_areas
from .energy import assemble as assemble, reference_of as reference_of, total_energy as total_energy
from .layout import move_tips as move_tips, patch_map as patch_map, relax as relax
from .pieces import Pieces as Pieces
from .quads import (
    Quads as Quads,
    chosen_joints as chosen_joints,
    cut_into_large_quads as cut_into_large_quads,
    cut_into_quads as cut_into_quads,
)
from .samples import centres as centres, locate_texels as locate_texels
from .seamless import (
    SeamlessMap as SeamlessMap,
    corner_places as corner_places,
    seamless_map as seamless_map,
)
from .surface import TriangleSurface as TriangleSurface, refined as refined
