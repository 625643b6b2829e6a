"""Owns the console that commands print on: plain text, as wide as the terminal."""

from __future__ import annotations

import sys

from rich.console import Console

PIPED_WIDTH = 120  # characters in a line when the output is not a terminal


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Leave it to the caller: rich would end the process as if a guard had stopped it."""
        raise BrokenPipeError


def console() -> Console:
    """Standard output, plain: names and paths are shown as they are."""
    return _Console(width=None if sys.stdout.isatty() else PIPED_WIDTH, highlight=False, markup=False, emoji=False)
