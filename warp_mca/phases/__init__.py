"""Phases of a run, and whole runs."""
