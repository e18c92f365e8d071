"""Scenes: an MJCF model, its targets, a camera and a script of timed events, read from one TOML file."""
