"""Measurements of the wave solver: how fast, how exact, and against what."""
