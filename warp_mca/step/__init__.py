"""Owns the small timescale: Solver, order of the stages, records, graphs."""
