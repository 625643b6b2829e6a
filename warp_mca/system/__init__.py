"""Owns what all that acts shares: Model, State, Stage and Actor, on the host and on a device."""
