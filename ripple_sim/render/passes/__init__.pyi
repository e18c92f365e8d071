from .deferred import (
    TILE as TILE,
    DeferredShading as DeferredShading,
    Mirror as Mirror,
    TransparentLayers as TransparentLayers,
    touched_tiles as touched_tiles,
)
from .shadows import (
    Floor as Floor,
    FloorOcclusion as FloorOcclusion,
    ShadowMaps as ShadowMaps,
    TransmissionMaps as TransmissionMaps,
    find_floor as find_floor,
)
