from .deferred import (
    TILE as TILE,
    DeferredShading as DeferredShading,
    Mirror as Mirror,
    TransparentLayers as TransparentLayers,
    touched_tiles as touched_tiles,
)
from .floor import Floor as Floor, FloorOcclusion as FloorOcclusion, find_floor as find_floor
from .shadow import ShadowMaps as ShadowMaps, TransmissionMaps as TransmissionMaps
from .surface_buffers import SurfaceBuffers as SurfaceBuffers, SurfaceImage as SurfaceImage
