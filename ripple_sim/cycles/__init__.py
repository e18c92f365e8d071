"""Frames by Cycles, Blender's path tracer, of the USD of a run."""

from .render import render_cycles

__all__ = ["render_cycles"]
