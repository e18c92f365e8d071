from .finite import CHECK_INTERVAL as CHECK_INTERVAL
from .footprint import (
    Footprint as Footprint,
    footprint_at as footprint_at,
    weigh_each as weigh_each,
)
from .height_map import (
    FREE_SHARE as FREE_SHARE,
    MAX_SHARE as MAX_SHARE,
    DeviceHeightMap as DeviceHeightMap,
    DisplacementLimit as DisplacementLimit,
    HeightMap as HeightMap,
)
from .load import Load as Load
from .motion import MovedGradients as MovedGradients
from .wave_solver import WaveSolver as WaveSolver
