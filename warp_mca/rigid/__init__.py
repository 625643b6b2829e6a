"""Owns the large timescale: chains of rigid links, hand-off and hand-back."""
