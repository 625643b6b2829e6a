"""Owns the cases of group waves."""
