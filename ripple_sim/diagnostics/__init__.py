"""Versions and drivers of this machine, and reasons why it cannot render."""
