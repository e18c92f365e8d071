"""Readers of mesh files, one a format: each makes a triangle soup with the looks of the file."""
