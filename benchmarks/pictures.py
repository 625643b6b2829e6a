"""Owns the size of the documentation's pictures in the repository."""

from __future__ import annotations

from pathlib import Path

WIDTH = 720  # [pixels]
COLOURS = 256


def shrink(picture: Path) -> None:
    """Write the picture again at the width of a page and with a palette of colours."""
    from PIL import Image

    with Image.open(picture) as image:
        width = min(WIDTH, image.width)
        small = image.convert("RGB").resize((width, round(width * image.height / image.width)))
    palette = small.quantize(COLOURS)
    small.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG).save(picture, optimize=True)
