"""From contact patches to forces on texels."""
