from .colliders import (
    ROUTES as ROUTES,
    convex_parts as convex_parts,
    inset as inset,
    make_collidable as make_collidable,
)
from .collision_geoms import named_collision_geoms as named_collision_geoms
from .contacts import (
    ContactReader as ContactReader,
    Contacts as Contacts,
    first_rows as first_rows,
    places_facing as places_facing,
)
from .energy import Energy as Energy, VelocityChange as VelocityChange
from .flex_contacts import FlexContacts as FlexContacts
from .geoms import (
    TARGET_TYPES as TARGET_TYPES,
    ByGeom as ByGeom,
    by_name as by_name,
    find_any as find_any,
    find_geom as find_geom,
    find_target as find_target,
    geom_name as geom_name,
    target_name as target_name,
)
from .high_pass import HighPass as HighPass, coarse_motions as coarse_motions
from .hooks import (
    adopt_warnings as adopt_warnings,
)
from .ids import (
    is_geom as is_geom,
    target_of_flex as target_of_flex,
)
from .load import (
    ContactLoads as ContactLoads,
    StepContacts as StepContacts,
    TargetLoad as TargetLoad,
)
from .model import (
    CoupledModel as CoupledModel,
    find_flex_colliders as find_flex_colliders,
    flex_thickness as flex_thickness,
)
from .own_model import (
    check_targets as check_targets,
    own_data as own_data,
    own_model as own_model,
    posed as posed,
)
from .patches import (
    MAX_CORNERS as MAX_CORNERS,
    Footprints as Footprints,
    corners as corners,
    load_points as load_points,
)
from .rest_filter import (
    NO_FORCES as NO_FORCES,
    RestFilter as RestFilter,
    TexelForces as TexelForces,
)
from .ripples import Impulse as Impulse, Ripples as Ripples
from .soft import (
    SoftSurface as SoftSurface,
    target_pose as target_pose,
)
from .solved_forces import (
    SolvedForces as SolvedForces,
)
from .stepping import (
    Passed as Passed,
    StepClock as StepClock,
    divergence as divergence,
    missed_warning as missed_warning,
    physics_errors as physics_errors,
)
from .suited import suited_targets as suited_targets
from .target_mesh import (
    height_field_triangles as height_field_triangles,
    primitive_triangles as primitive_triangles,
    target_atlas as target_atlas,
)
from .target_warnings import GAP_TOLERANCE as GAP_TOLERANCE, hull_gap as hull_gap
from .tunnelling import PAIR as PAIR, TunnellingCheck as TunnellingCheck, too_fast as too_fast
from .two_way import support_point as support_point
