"""Random scenes that contact must get right, and their judge: `python -m benchmarks.random_scenes`."""
