"""Owns the size of the documentation's pictures in the repository."""

from __future__ import annotations

from pathlib import Path

WIDTH = 720  # [pixels]
COLOURS = 256
NEAR_WHITE = 250


def shrink(picture: Path) -> None:
    """Write the picture again at the width of a page and with a palette of colours."""
    from PIL import Image

    with Image.open(picture) as image:
        width = min(WIDTH, image.width)
        small = image.convert("RGB").resize((width, round(width * image.height / image.width)))
    palette = small.quantize(COLOURS)
    palette.putpalette(whitened(palette.getpalette() or []))
    small.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG).save(picture, optimize=True)


def whitened(palette: list[int]) -> list[int]:
    """A palette of red, green and blue in turn, its near whites made white: the paper of the figures."""
    colours = [palette[i : i + 3] for i in range(0, len(palette), 3)]
    return [value for colour in colours for value in ((255, 255, 255) if min(colour) >= NEAR_WHITE else colour)]
