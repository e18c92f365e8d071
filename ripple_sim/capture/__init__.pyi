from .frame_source import (
    FrameSource as FrameSource,
    Sensor as Sensor,
    Sighting as Sighting,
    focal_distance as focal_distance,
    passes_of as passes_of,
    surface_of as surface_of,
    viewpoint as viewpoint,
)
from .snapshot import (
    ShutterTimes as ShutterTimes,
    Snapshot as Snapshot,
    disc_points as disc_points,
    drawn_heights as drawn_heights,
    exposures_of as exposures_of,
    snapshots as snapshots,
    state_digest as state_digest,
)
