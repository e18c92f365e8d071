"""Universal Scene Description: the moving geometry, camera, lamps and looks of a run."""
