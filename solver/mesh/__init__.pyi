from .files import check_mesh_file as check_mesh_file, load_mesh as load_mesh
from .mesh import (
    Mesh as Mesh,
    check_genus_zero as check_genus_zero,
    vertex_normals as vertex_normals,
)
from .queries import (
    ClosestPoints as ClosestPoints,
    RayScene as RayScene,
    downward_hits as downward_hits,
)
from .repair import repaired as repaired
from .soup import Soup as Soup, triangulate as triangulate
from .topology import (
    SPLITS as SPLITS,
    Edges as Edges,
    Folds as Folds,
    counting_sort as counting_sort,
    edges_of as edges_of,
    undirected as undirected,
)
from .vectors import (
    Vector as Vector,
    combine as combine,
    cross as cross,
    dot as dot,
    row as row,
    subtract as subtract,
    unit as unit,
)
from .volume import Volume as Volume, is_volume as is_volume, load_volume as load_volume
from .wrap import Wrap as Wrap
