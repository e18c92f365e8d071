from .build import (
    LAYOUTS as LAYOUTS,
    atlas_from_sphere_map as atlas_from_sphere_map,
    build_atlas as build_atlas,
    load_atlas as load_atlas,
)
from .energy import (
    COLUMN as COLUMN,
    FIXED as FIXED,
    FREE as FREE,
    ROW as ROW,
    TERMS as TERMS,
    Density as Density,
    Reference as Reference,
    density_derivatives as density_derivatives,
    descend as descend,
    energy_density as energy_density,
    expand_star as expand_star,
    projected_hessian as projected_hessian,
    star_energy as star_energy,
    star_slopes as star_slopes,
    tangent_move as tangent_move,
)
from .newton import (
    CG_TOLERANCE as CG_TOLERANCE,
    System as System,
    add_triangle as add_triangle,
    conjugate_gradients as conjugate_gradients,
    descend_by_newton as descend_by_newton,
    line_search as line_search,
)
