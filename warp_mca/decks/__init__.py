"""Owns LS-DYNA keyword decks as scenes: `read_deck`."""
