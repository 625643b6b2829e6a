"""Owns the kernels of contact: search, projection, springs, friction."""
