"""The texel mesh: charts of texels, how they are connected, and what is computed on them; the atlas on a surface."""
