"""Backends: who computes the waves, on the CPU or in compute shaders."""
