"""Overlays on frames: heatmap, contacts, texel grid, time, energy; titles for two runs side by side."""
