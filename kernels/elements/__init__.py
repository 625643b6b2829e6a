"""Owns the kernels of internal forces of the elements."""
