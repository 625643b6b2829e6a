"""Owns the cases of group material."""
