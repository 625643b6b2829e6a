"""Owns the cases of group friction."""
