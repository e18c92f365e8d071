"""Frames by Cycles, Blender's path tracer, of the USD of a run."""

from .render_cycles import render_cycles

__all__ = ["render_cycles"]
