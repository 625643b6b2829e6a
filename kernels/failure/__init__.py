"""Owns the kernels of failure: criteria, and how elements that meet them are removed."""
