"""The film of a scene: simulation, drawing and encoding at the same time."""
