"""From a mesh to its atlas: the cube and patch layouts, the cache, the files."""
