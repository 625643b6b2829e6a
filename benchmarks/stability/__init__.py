"""Owns stability.md of docs/measurements/: runs at extremes of each parameter, held to closed forms or finer runs."""
