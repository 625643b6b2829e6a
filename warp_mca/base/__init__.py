"""Owns what every part uses: errors, validation, files, rotations."""
