"""Floating frames, in which elements of bodies that turn compute."""
