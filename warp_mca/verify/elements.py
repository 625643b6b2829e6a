"""Owns the cases of group elements."""
