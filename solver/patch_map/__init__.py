"""The patch layout's map: any surface cut into cells, these into square charts, with a fold-free map onto them."""
