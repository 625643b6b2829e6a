"""Owns the kernels of loads on nodes."""
