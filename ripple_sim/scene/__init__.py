"""Scenes: an MJCF model, the surfaces that ripple, a camera and a script of timed events, read from one TOML file."""
