"""Owns the row about bolts that bear compression."""

from __future__ import annotations

from collections.abc import Iterator

from warp_mca.scene import Bolt
from warp_mca.watch.row import Finished, Values, row


@row(
    "bolt {name} bore a compression of {force:.3g} N, as a stud does; the head of a screw would lift and bear none;",
    "if it has one, {remedy}, or let its bodies press on each other beside it",
    0.05,
    "of its greatest tension or shear force at most",
)
def bolt_in_compression(c: Finished, most: float) -> Iterator[Values]:
    """Greatest compression of each bolt, which is a beam."""
    for bolt in (load for load in c.scene.loads if isinstance(load, Bolt)):
        axial, shear = (c.history[column.format(bolt.name)] for column in bolt.readings)
        force, other = -float(axial.min()), float(max(axial.max(), shear.max()))
        if force > most * other:
            remedy = "raise its preload" if bolt.preload else "give it its preload"
            yield dict(name=bolt.name, force=force, remedy=remedy)
