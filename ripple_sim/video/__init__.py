"""Videos of scenes: simulation, rendering and encoding at the same time."""
