"""Owns absorbing boundaries: sides of a body that let waves leave, so that a small box stands for a large body."""

from __future__ import annotations

from dataclasses import dataclass

from warp_mca.base import validate


@dataclass(frozen=True, kw_only=True)
class Absorbing:
    """Boundary faces with dashpots, as if the body went on beyond them without end (Lysmer and Kuhlemeyer, 1969).

    The dashpots resist motion relative to the body's own velocity at the start, which must be a translation: the large
    body that the box stands for keeps it. docs/theory.md has the equations, and how much is reflected at each angle.

    Attributes:
        body: body that owns the set.
        nodes: node set of its mesh; the faces of the boundary all of whose corners belong to it absorb.
    """

    body: str
    nodes: str

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Absorbing", body=self.body, nodes=self.nodes)
