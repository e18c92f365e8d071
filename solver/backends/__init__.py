"""Backends: the waves computed on the CPU or in compute shaders."""
