"""The names of the layouts: how a mesh gets its charts."""

# "auto" takes the first of the others that fits a mesh.
LAYOUTS = ("auto", "cube", "patches")
