"""Owns the kernels of what depends on the device: scalars, lanes, shared memory, launches."""
