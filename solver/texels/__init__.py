"""The cube-map atlas: a mesh and its sphere map, sampled on six grids of texels that close into one surface."""
