"""Materials, and the discrete wave operator of an atlas."""
