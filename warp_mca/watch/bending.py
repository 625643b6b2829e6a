"""Owns what the shape of bodies says of bending in a run: how far their cells make it too flexible or too stiff.

Of each cell that is looked at, `bent_hexahedra` and `strain_jumps` give the strain energy that its element spends on
its shape and that of a cell that bends right. Under given loads, deflections are off by the ratio of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cell_types import HEXAHEDRON, WEDGE
from warp_mca.geometry.degenerate import among
from warp_mca.watch import bent_hexahedra, strain_jumps
from warp_mca.watch.bent_cells import BENT, COLUMNS, FLOW, FLOWING, FOLDED, MISSED, RIGHT, SPENT, Cells
from warp_mca.watch.folding import corner_volumes, folded, may_fold
from warp_mca.watch.row import Array, Finished, Values, When, row

if TYPE_CHECKING:
    from warp_mca.system.block import Block
    from warp_mca.system.model import Model

# Error of deflections from which on a word is said. Of two bodies that strike, forces and times go with the root of the
# stiffness at most; strains of wedges and tet4 jump where they are not bent, too.
ERROR, STRUCK, JUMPING = 0.03, 0.2, 0.08
SINGLE = (
    0.08  # of strain energy in bending of single cells: three layers; less comes of squeezed rubber, which is right
)
# Cells of a body up to which all are looked at, and how many, evenly spread, of more: where strain jumps those around
# them count, too, and all of 80,000 take 0.2 s.
WHOLE, SAMPLE = {False: 1024, True: 16_384}, {False: 1024, True: 256}
STRAIGHT = {"hex8i", "hex8w", "hex8w3", "hex8r"}  # bend right but where sides of their cells lean across the wall
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
LEANING = "let the sides of cells go straight through the wall, or choose tet10"
LEAST = 0.02  # of the energy that bodies exchanged: less strain energy says nothing
FREE = 1e-4  # of all energy: rounding leaves less in bodies that move free of stress
LOOKS = 8  # in a run, besides that at its end

Found = tuple[Callable[[Array, Cells], Array], Callable[[Cells], object]]  # what finds columns, and what prepares it
# That of energies, by element and whether cells are wedges.
_ENERGIES: dict[tuple[str, bool], Found] = {
    ("hex8", False): (bent_hexahedra.full_hexahedra, bent_hexahedra.bricks_of),
    ("hex8", True): (partial(strain_jumps.wedges, element="hex8"), strain_jumps.wedges_of),
    ("hex8i", False): (bent_hexahedra.enriched_hexahedra, bent_hexahedra.bricks_of),
    ("hex8w", False): (bent_hexahedra.walls, bent_hexahedra.bricks_of),
    ("hex8w3", False): (bent_hexahedra.walls, bent_hexahedra.bricks_of),
    ("hex8r", False): (bent_hexahedra.one_point_hexahedra, bent_hexahedra.bricks_of),
    ("hex8r", True): (partial(strain_jumps.wedges, element="hex8r"), strain_jumps.one_point_wedges_of),
    ("wedge6", True): (partial(strain_jumps.wedges, element="wedge6"), strain_jumps.wedges_of),
    ("tet4", False): (strain_jumps.tetrahedra, strain_jumps.slopes_of),
}


def samples_of(model: Model) -> list[Cells]:
    """Cells of a scene's model that are looked at."""
    found = []
    for block in model.blocks:
        folds = may_fold(block)
        if not (folds or any(block.element == element for element, _ in _ENERGIES)):
            continue
        if block.failing:  # cells that fail are bent out of shape before
            continue
        wedge = _wedges(block)
        kind = _body_of(model, block) * len(model.law) + block.material
        for k in np.flatnonzero(np.bincount(kind)):
            body, material = divmod(int(k), len(model.law))
            sigma_y = float(model.law[material, 2:3].sum()) if block.plastic else 0.0
            if folds:
                own = np.flatnonzero(kind == k)
                found.append(_sample(model, block, own, body, material, False, sigma_y, (folded, corner_volumes)))
            for jumps in (False, True):
                own = np.flatnonzero((kind == k) & (wedge == jumps))
                if len(own) and (block.element, jumps) in _ENERGIES:
                    finds = _ENERGIES[block.element, jumps]
                    cells = _sample(model, block, own, body, material, jumps, sigma_y, finds)
                    yields = sigma_y > 0.0 and block.element in ("hex8i", "hex8r")
                    if jumps or yields or block.element not in STRAIGHT or bent_hexahedra.lean(cells):
                        found.append(cells)
    return found


def _sample(
    model: Model, block: Block, own: NDArray[np.intp], body: int, material: int, wedge: bool, sigma_y: float, by: Found
) -> Cells:
    """The cells to look at out of the body's `own` ones of one material and type."""
    jumps = wedge or block.element == "tet4"
    chosen = own if len(own) <= WHOLE[jumps] else own[_spread(len(own), SAMPLE[jumps])]
    cells = _with_neighbours(block.conn, chosen, own) if jumps else chosen
    conn = block.conn[list(WEDGE.stored_corners)] if block.element == "wedge6" else block.conn
    K, G = model.law[material, :2]
    energies, prepare = by
    share = len(own) / len(chosen)
    return Cells(body, energies, conn[:, cells].T, len(chosen), K, G, sigma_y, share, model.X, prepare)


def _spread(total: int, count: int) -> NDArray[np.intp]:
    """So many numbers below `total`, one at a varying place of each equal part: even steps would follow the layers."""
    k = np.arange(count)
    return np.floor((k + k * GOLDEN % 1.0) * (total / count)).astype(np.intp)


def _wedges(block: Block) -> NDArray[np.bool_]:
    """Which cells of a block are wedges, shape (element_count,)."""
    if block.element == "wedge6":
        return np.ones(block.conn.shape[1], dtype=bool)
    if len(block.conn) != HEXAHEDRON.corners:
        return np.zeros(block.conn.shape[1], dtype=bool)
    return among(block.conn.T, WEDGE.name)


def _with_neighbours(conn: NDArray[np.int32], chosen: NDArray[np.intp], own: NDArray[np.intp]) -> NDArray[np.intp]:
    """Chosen cells, then those of their `own` body that share a node with one of them."""
    near = np.zeros(int(conn.max()) + 1, dtype=bool)
    near[conn[:, chosen]] = True
    beside = np.logical_or.reduce([near[corner[own]] for corner in conn])
    beside[np.searchsorted(own, chosen)] = False
    return np.concatenate([chosen, own[beside]])


@np.errstate(all="ignore")  # what is not a number is not above a share
def seen(model: Model, samples: list[Cells], u: Array, before: Array) -> Array:
    """Energies of each body as `SceneRecords.stiffened` has them, of the shape with more strain energy.

    Args:
        model: of the scene alone.
        samples: its cells that are looked at.
        u: displacements [m], shape (node_count, 3), float64.
        before: what was seen before, shape (body_count, COLUMNS), float64, or empty.
    """
    found = np.zeros((len(model.element_start), COLUMNS))
    if np.isfinite(u).all():
        for item in samples:
            found[item.body] += item.share * item.energies(u, item)
    return greater(found, before)


def greater(found: Array, before: Array) -> Array:
    """Energies of each body, of what was found now or before, shape (body_count, COLUMNS) or empty.

    It is that with more strain energy, and of folded cells that with more.
    """
    before = before if before.shape == found.shape else np.zeros_like(found)
    more = found[:, SPENT, None] > before[:, SPENT, None]  # not-a-number is not greater
    most = np.where(more, found, before)
    most[:, FOLDED] = np.fmax(found[:, FOLDED], before[:, FOLDED])
    return most


@row(
    "{elements} {makes} {body} too {which} in bending, its deflections about {error:.0%} too {small}: {bent:.0%} of "
    "the strain energy of {body} lay {where} when it was greatest;",
    "{remedy}",
    ERROR,
    f"of deflections at most; {JUMPING:g} where strain jumps between cells, {STRUCK:g} where bodies struck",
    when=When.LOOKS,
)
def bending(c: Finished, most: float) -> Iterator[Values]:
    """Strain energy of cells that bend right over that of the body's cells, when this was greatest."""
    for body, sums in _bodies(c):
        kinds = _kinds(c.model, body)
        error = sums[RIGHT] / sums[SPENT] - 1.0
        limit = STRUCK if c.ledger.kept.touched else JUMPING if kinds.jump else most
        if -error > limit or (error > limit and sums[BENT] > SINGLE * sums[SPENT]):
            single = "in bending of single cells" if kinds.elements != {"tet4"} else ""
            where = " and ".join(filter(None, (single, "in jumps of strain between cells" if kinds.jump else "")))
            yield dict(
                elements=" and ".join(sorted(kinds.elements)), makes="make" if len(kinds.elements) > 1 else "makes",
                body=body, error=abs(error), where=where,
                which="flexible" if error > 0.0 else "stiff", small="large" if error > 0.0 else "small",
                bent=sums[BENT] / sums[SPENT],
                remedy=kinds.remedy if kinds.jump or "hex8" in kinds.elements else LEANING,
            )  # fmt: skip


@row(
    "cells of {body} yield too {early} in bending, at about {flow:.2f} times the plastic moment;",
    "{remedy}",
    0.1,
    f"of the plastic moment at most, above or below; {STRUCK:g} where bodies struck, but of hex8i",
    when=When.LOOKS,
)
def bending_flow(c: Finished, most: float) -> Iterator[Values]:
    """Equivalent strain of cells that yield in bending over that of cells that bend right."""
    for body, sums in _bodies(c):
        flow = sums[FLOWING] / sums[FLOW] if sums[FLOW] > 0.0 else 1.0
        kinds = _kinds(c.model, body)
        limit = STRUCK if c.ledger.kept.touched and "hex8i" not in kinds.elements else most
        if abs(flow - 1.0) > limit:
            yield dict(body=body, early="early" if flow < 1.0 else "late", flow=flow, remedy=kinds.remedy)


@row(
    "hex8r does not let {body} yield where bending of single cells alone exceeds the yield stress: deflections and "
    "plastic work are too small;",
    "{remedy}",
    0.02,
    "of the strain energy at most",
    when=When.LOOKS,
)
def bending_without_flow(c: Finished, most: float) -> Iterator[Values]:
    """Energy of bending stresses beyond yield that do not yield."""
    for body, sums in _bodies(c):
        if sums[MISSED] > most * sums[SPENT]:
            yield dict(body=body, remedy=_kinds(c.model, body).remedy)


class Kinds(NamedTuple):
    """Elements of a body, whether strain jumps between some of its cells, and whether its material can yield."""

    elements: set[str]
    jump: bool
    yields: bool

    @property
    def remedy(self) -> str:
        """What makes a body of such cells bend right."""
        if "tet4" in self.elements:
            return "choose tet10, or smaller cells"
        layers = "two or more cells over the thickness, or hex8w"
        if self.elements == {"hex8i"}:
            return f"take {layers}"
        way = ["choose hex8i"] if self.elements & {"hex8", "hex8r"} else []
        if self.jump:
            way.append("let axes of wedges go through the wall")
        if self.yields:
            way.append(f"where walls yield, take {layers}")
        elif self.jump:
            way.append("or choose smaller cells")
        return ", ".join(way)


def _bodies(c: Finished) -> Iterator[tuple[str, Array]]:
    """Bodies with strain energy that tells something: names and energies."""
    if c.stopped:
        return
    kept = c.ledger.kept
    for name, sums in zip(c.model.element_start, c.bent, strict=False):  # empty without cells that are looked at
        if sums[SPENT] > max(LEAST * kept.exchanged, FREE * kept.energy_scale):
            yield name, sums


def _kinds(model: Model, name: str) -> Kinds:
    elements, jump, yields = set(), False, False
    number = list(model.element_start).index(name)
    for block in model.blocks:
        own = _body_of(model, block) == number
        if own.any():
            elements.add(block.element)
            jump = jump or block.element == "tet4" or bool(_wedges(block)[own].any())
            yields = yields or block.plastic
    return Kinds(elements, jump, yields)


def _body_of(model: Model, block: Block) -> NDArray[np.intp]:
    """Number of the body of each element of a block, in the order of `Model.element_start`."""
    own = model.element_of[block.first : block.first + block.conn.shape[1]]
    start = np.array(list(model.element_start.values()))
    order = np.argsort(start, kind="stable")
    return order[np.searchsorted(start[order], own, side="right") - 1]
