"""Owns what a run leaves behind: results, histories of forces and paths, files."""
