"""Owns the kernels of what advances nodes: integration, constraints."""
