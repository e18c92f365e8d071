"""Encoding: frames go in one by one, a finished file or folder of frames appears at the end or not at all."""

from .output import check_output, default_fps
from .writer import FrameWriter, open_writer

__all__ = ["FrameWriter", "check_output", "default_fps", "open_writer"]
