"""Waves too high or too steep for the object that carries them."""
