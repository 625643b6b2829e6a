"""Owns docs/stability.md: runs at the extremes of every parameter, each held to a closed form or a finer run."""
