"""Owns the small timescale: time step, stages, threads."""
