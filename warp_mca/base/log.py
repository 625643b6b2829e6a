"""Owns the logger that warnings go to while a run goes on."""

from __future__ import annotations

import logging
from collections.abc import Iterable

LOGGER = "warp_mca"  # its name


def warn(sentences: Iterable[str]) -> None:
    """Log warnings, each once."""
    for sentence in dict.fromkeys(sentences):
        logging.getLogger(LOGGER).warning("%s", sentence)
