"""How geoms collide with a target's true surface, and what can go wrong."""
