"""Owns absorbing boundaries: sides through which waves leave, so that a small box stands for a large body."""

from __future__ import annotations

from dataclasses import dataclass

from warp_mca.base import validate
from warp_mca.scene.bodies import Vec3


@dataclass(frozen=True, kw_only=True)
class Absorbing:
    """Boundary faces with dashpots, as if the body went on beyond them without end (Lysmer and Kuhlemeyer, 1969).

    Dashpots resist motion relative to the body's own velocity at the start, which must be a translation: the large
    body that the box stands for keeps it. They let a steady load push the box away; with a `centre`, springs hold it as
    a large body around it would. docs/theory.md has the equations, and how much is reflected at each angle.

    Attributes:
        body: body that owns the set.
        nodes: node set of its mesh; the faces of the boundary all of whose corners belong to it absorb.
        centre: where the loads act, in the body's frame [m]; None: dashpots alone.
    """

    body: str
    nodes: str
    centre: Vec3 | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Absorbing", body=self.body, nodes=self.nodes)
        if self.centre is not None:
            validate.vectors("Absorbing", centre=self.centre)
