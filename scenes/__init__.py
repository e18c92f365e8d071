"""The shipped scenes: MJCF models, their TOML settings, and the meshes they stand on."""
