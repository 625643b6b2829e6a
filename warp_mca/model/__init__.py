"""Owns how a scene becomes a Model: assembly, stable step, mass scaling, several rates, joining of scenes."""
