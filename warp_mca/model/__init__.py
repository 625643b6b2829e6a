"""Owns a scene as arrays that never change: assembly, constraints, contact surfaces, stable step."""
