"""Rigid bodies beside finite elements."""
