"""Contact patches: the areas on a target over which geoms touch it."""
