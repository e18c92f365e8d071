"""Waves on an atlas: the operator, the sources, the materials and the backends that step them."""
