from .exposure import FilmExposure as FilmExposure
from .frame_source import FrameSource as FrameSource, surface_of as surface_of
from .scene_camera import focal_distance as focal_distance, viewpoint as viewpoint
from .sighting import Sighting as Sighting, passes_of as passes_of
from .snapshot import (
    ShutterTimes as ShutterTimes,
    Snapshot as Snapshot,
    disc_points as disc_points,
    drawn_heights as drawn_heights,
    exposures_of as exposures_of,
    snapshots as snapshots,
    state_digest as state_digest,
)
