"""Contact patches: the areas on a target that geoms press."""
