"""Owns the kernels of material laws."""
