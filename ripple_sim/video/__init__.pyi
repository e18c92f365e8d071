from .options import VideoOptions as VideoOptions
from .render_video import (
    Film as Film,
    Progress as Progress,
    Shot as Shot,
    Summary as Summary,
    open_video as open_video,
    prefetched as prefetched,
)
from .settings import (
    EXPOSURE as EXPOSURE,
    check_options as check_options,
    frame_count as frame_count,
    origin as origin,
    scene_digest as scene_digest,
    settled as settled,
)
