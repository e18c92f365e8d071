"""The names of the layouts: how a mesh gets its charts."""

from __future__ import annotations

# "auto" takes the first of the others that fits a mesh.
LAYOUTS = ("auto", "cube", "patches")
