"""Owns the argument that names a folder."""

from __future__ import annotations

import argparse
from pathlib import Path


def folder(text: str) -> Path:
    """The path of a folder; an empty name is refused, because it would mean the working directory.

    Raises:
        argparse.ArgumentTypeError: it is empty.
    """
    if not text:
        raise argparse.ArgumentTypeError("'': name a folder, or . for this one")
    return Path(text)
