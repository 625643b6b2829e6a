"""Owns the outcome of a run: results, histories of forces and paths, files."""
