from .clip import (
    H264 as H264,
    LOSSLESS as LOSSLESS,
    VP9 as VP9,
    Clip as Clip,
    Codec as Codec,
    Stream as Stream,
    join_clips as join_clips,
)
from .formats import (
    ENDINGS as ENDINGS,
    FORMATS as FORMATS,
    FRAMES_IN_CLIP as FRAMES_IN_CLIP,
    Format as Format,
    Segments as Segments,
    default_fps as default_fps,
    video_format as video_format,
)
from .gif import join_gif as join_gif
from .output import check_output as check_output, check_size as check_size
from .part import STATES as STATES, Part as Part
from .passes import PassFiles as PassFiles, check_passes as check_passes
from .replace import (
    MARK as MARK,
    made_here as made_here,
    move as move,
    png_mark as png_mark,
)
from .webp import join_webp as join_webp
from .writer import FrameWriter as FrameWriter, open_writer as open_writer
