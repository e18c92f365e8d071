from .certificate import (
    Certificate as Certificate,
    certify as certify,
    solid_angles as solid_angles,
    stretch as stretch,
)
from .conformal import conformal_sphere_map as conformal_sphere_map
from .decimation import (
    collapse as collapse,
    corner_table as corner_table,
    decimate as decimate,
    following as following,
    gather_star as gather_star,
    is_collapsible as is_collapsible,
    preceding as preceding,
    undo_collapse as undo_collapse,
    vertex_quadrics as vertex_quadrics,
)
from .level import (
    RealSurface as RealSurface,
    build_level as build_level,
    carry as carry,
    star_shapes as star_shapes,
    update_level as update_level,
    update_load as update_load,
    update_triangle as update_triangle,
)
from .progressive import (
    SPHERE as SPHERE,
    TETRAHEDRON as TETRAHEDRON,
    assemble as assemble,
    insert_vertices as insert_vertices,
    newton_step as newton_step,
    progressive_sphere_map as progressive_sphere_map,
    relax_level as relax_level,
    sweep as sweep,
    tangent_frame as tangent_frame,
    total_energy as total_energy,
)
