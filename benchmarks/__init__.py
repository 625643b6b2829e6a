"""Runs that the documentation quotes: `python -m benchmarks.results`."""
