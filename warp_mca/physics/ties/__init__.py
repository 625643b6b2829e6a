"""Nodes tied to faces."""
