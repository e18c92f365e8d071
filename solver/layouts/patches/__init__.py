"""The patch layout: any surface cut into cells, these into square charts with a fold-free map; texels on them."""
