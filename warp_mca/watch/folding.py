"""Owns cells of rubber that folded: inside out at a corner, though not at the points where their element looks.

Rubber that is pressed far enough buckles into its free surfaces, in waves of any length: at stretches of 0.44 along one
axis and 0.67 along two for the neo-Hookean half-space (Biot, Appl. Sci. Res. A 12 (1963) 168), at 0.55 for some of
Ogden's. The waves that a mesh can have decide when it does so, by folding its cells; force falls to a fraction.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, cast

import numpy as np

from warp_mca.geometry.cell_types import HEXAHEDRON
from warp_mca.geometry.hexahedron import CORNERS
from warp_mca.geometry.tetra10 import edges_at
from warp_mca.watch.bent_cells import COLUMNS, FOLDED, Array, Cells
from warp_mca.watch.row import Finished, Values, When, row

if TYPE_CHECKING:
    from warp_mca.system.block import Block

FOLDING = {"hex8", "hex8i", "hex8w", "hex8w3", "hex8r", "tet10", "tet10_mean"}  # their points are not at the corners
LEAST = 1e-6  # of the greatest of a cell's corners as it was: less have those that coincide
_NEXT = np.array([[np.flatnonzero((c * (1 - 2 * e) == CORNERS).all(axis=1))[0] for e in np.eye(3)] for c in CORNERS])


def may_fold(block: Block) -> bool:
    """Whether cells of a block are rubber, of an element that does not see them fold."""
    if block.element not in FOLDING or not block.finite:
        return False
    from warp_mca.kernels.materials.laws import law_functions

    law = law_functions(block.law, "mixed")
    return law.hyperelastic or (law.relaxes and law.elliptic)


def corner_volumes(cells: Cells) -> Array:
    """Determinants of the edges at the corners of cells as they were [m^3], shape (cell_count, corner_count)."""
    return _corners(cells.x)


def _corners(x: Array) -> Array:
    if x.shape[1] == HEXAHEDRON.corners:
        return np.linalg.det(x[:, _NEXT] - x[:, :, None])
    return np.linalg.det(edges_at(x, np.eye(4)))


def folded(u: Array, cells: Cells) -> Array:
    """What `bent_cells` names: how many of the cells are inside out at a corner, shape (COLUMNS,)."""
    before = cast(Array, cells.shape)
    whole = np.abs(before) > LEAST * np.abs(before).max(axis=1, keepdims=True)
    found = np.zeros(COLUMNS)
    found[FOLDED] = ((_corners(cells.x + u[cells.conn]) * before < 0.0) & whole).any(axis=1).sum()
    return found


@row(
    "{share:.0%} of the cells of {body} folded, inside out at a corner: its rubber has buckled, and forces may be a "
    "fraction of the right ones;",
    "press it less, since free surfaces of rubber wrinkle where stretches fall below about 0.5 along one axis or 0.65 "
    "along two, or hold them",
    0.02,
    "of the cells at most",
    when=When.LOOKS,
)
def folded_rubber(c: Finished, most: float) -> Iterator[Values]:
    """Cells of rubber that are inside out at a corner, at the look that saw most of them."""
    for name, sums in zip(c.model.element_start, c.bent, strict=False):  # empty without cells that are looked at
        if sums[FOLDED]:
            share = sums[FOLDED] / sum(len(cells) for cells in c.meshes[name].cells.values())
            if share > most:
                yield dict(body=name, share=share)
