"""From a mesh to its atlas: the layouts, the cache, the files."""
