"""Owns whole runs: phases in turn, records, guards, batches, sweeps."""
