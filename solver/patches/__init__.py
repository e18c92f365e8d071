"""The patch layout: the texels of charts on any surface."""
