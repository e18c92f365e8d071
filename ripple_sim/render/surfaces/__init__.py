"""Rippled surfaces: tessellation, height maps, appearance."""
