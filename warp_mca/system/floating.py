"""Owns the arrays of floating frames."""

from __future__ import annotations

from dataclasses import dataclass

from warp_mca.base.arrays import Index


@dataclass(frozen=True, kw_only=True)
class FloatingFrames:
    """A frame for each body, those of each scene in turn.

    Attributes:
        frame: of each node, shape (node_count,), int32.
        marker: nodes that each frame follows, shape (frame_count, 4), int32.
    """

    frame: Index
    marker: Index
