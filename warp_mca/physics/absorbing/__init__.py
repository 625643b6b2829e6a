"""Absorbing boundaries."""
