"""Recorders: what writes a run's results while it goes on."""
