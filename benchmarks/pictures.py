"""Owns the size of the documentation's pictures in the repository."""

from __future__ import annotations

from pathlib import Path

WIDTH = 720  # [pixels]
COLOURS = 128


def shrink(picture: Path) -> None:
    """Write the picture again at the width of a page and with few colours."""
    from PIL import Image

    with Image.open(picture) as image:
        width = min(WIDTH, image.width)
        small = image.convert("RGB").resize((width, round(width * image.height / image.width)))
    small.quantize(COLOURS).save(picture, optimize=True)
