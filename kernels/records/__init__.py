"""Owns the kernels of sums and fields that a run records."""
