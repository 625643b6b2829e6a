"""Owns the cases of group rigid."""
