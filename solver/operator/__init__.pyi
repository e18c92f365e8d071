from .assembly import (
    OPERATORS as OPERATORS,
    build_operator as build_operator,
    source_grip as source_grip,
)
from .coefficients import (
    LIMITS as LIMITS,
    check_mask as check_mask,
    check_numbers as check_numbers,
    require_positive as require_positive,
)
from .curvatures import STEPS as STEPS, Curvatures as Curvatures
from .deep_water import (
    FluidOperator as FluidOperator,
    HalfLaplacian as HalfLaplacian,
    factorised as factorised,
)
from .material import (
    SHORTEST_TEXELS as SHORTEST_TEXELS,
    STIFF as STIFF,
    Material as Material,
    decay_time as decay_time,
    frequency as frequency,
    phase_speed as phase_speed,
    warn_of_wavelengths as warn_of_wavelengths,
)
from .modes import Modes as Modes, elastic_matrix as elastic_matrix
from .moving_operator import MovingOperator as MovingOperator
from .plate_rim import RIMS as RIMS, Rim as Rim
from .presets import PRESETS as PRESETS
from .regions import absorbing_damping as absorbing_damping, hold as hold
from .step import (
    StepCoefficients as StepCoefficients,
    damped_step as damped_step,
    number_or_field as number_or_field,
    step_coefficients as step_coefficients,
)
from .suited_law import (
    BOUNCE as BOUNCE,
    damping_for as damping_for,
    density_after as density_after,
    density_for as density_for,
    density_under as density_under,
    narrow_stiffness as narrow_stiffness,
    stiffness_under as stiffness_under,
)
from .volume import (
    VolumeBalance as VolumeBalance,
    VolumeRate as VolumeRate,
    volume_rate as volume_rate,
)
from .wave_operator import SAFETY as SAFETY, WaveOperator as WaveOperator
