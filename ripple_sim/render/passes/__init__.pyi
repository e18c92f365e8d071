from .deferred import (
    TILE as TILE,
    DeferredShading as DeferredShading,
    Mirror as Mirror,
    TransparentLayers as TransparentLayers,
    touched_tiles as touched_tiles,
)
from .floor import Floor as Floor, find_floor as find_floor
from .floor_occlusion import FloorOcclusion as FloorOcclusion
from .shadows import ShadowMaps as ShadowMaps, TransmissionMaps as TransmissionMaps
