"""Owns the comparison with other codes; each script here runs one and prints a line of JSON."""
