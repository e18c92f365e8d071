"""The passes of a frame: shadow maps, floor, G-buffer, deferred shading."""
