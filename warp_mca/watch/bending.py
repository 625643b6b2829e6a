"""Owns what the shape of bodies says of bending in a run: how far their cells make it too flexible or too stiff.

Of each cell that is looked at, `bent_hexahedra` and `strain_jumps` give the strain energy that its element spends on
its shape and that of a cell that bends right. Under given loads, deflections are off by the ratio of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cell_types import HEXAHEDRON, WEDGE
from warp_mca.geometry.degenerate import cell_names
from warp_mca.watch import bent_hexahedra, strain_jumps
from warp_mca.watch.bent_cells import BENT, COLUMNS, FLOW, FLOWING, MISSED, RIGHT, SPENT, Cells

if TYPE_CHECKING:
    from warp_mca.model.assembly import Block
    from warp_mca.model.model import Model

Array = NDArray[np.float64]

# Error of deflections, and of the plastic moment, from which on a word is said. Of two bodies that strike, forces and
# times go with the root of the stiffness at most; strains of wedges and tet4 jump where they are not bent, too.
ERROR, STRUCK, JUMPING, PLASTIC = 0.03, 0.2, 0.08, 0.1
SINGLE = (
    0.08  # of strain energy in bending of single cells: three layers; less comes of squeezed rubber, which is right
)
MISSING = 0.02  # share of strain energy in bending stresses beyond yield that do not yield, likewise
# Cells of a body up to which all are looked at, and how many, evenly spread, of more: where strain jumps those around
# them count, too, and all of 80,000 take 0.2 s.
WHOLE, SAMPLE = {False: 1024, True: 16_384}, {False: 1024, True: 256}
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
LEAST = 0.02  # of the energy that bodies exchanged: less strain energy says nothing
FREE = 1e-4  # of all energy: rounding leaves less in bodies that move free of stress
LOOKS = 8  # in a run, besides that at its end

# What finds the energies, and what prepares it, by element and whether cells are wedges.
_ENERGIES: dict[tuple[str, bool], tuple[Callable[[Array, Cells], Array], Callable[[Cells], object]]] = {
    ("hex8", False): (bent_hexahedra.full_hexahedra, bent_hexahedra.bricks_of),
    ("hex8", True): (strain_jumps.full_wedges, strain_jumps.wedges_of),
    ("hex8r", False): (bent_hexahedra.one_point_hexahedra, bent_hexahedra.bricks_of),
    ("hex8r", True): (strain_jumps.one_point_wedges, strain_jumps.one_point_wedges_of),
    ("tet4", False): (strain_jumps.tetrahedra, strain_jumps.slopes_of),
}


def samples_of(model: Model) -> list[Cells]:
    """Cells of a scene's model that are looked at."""
    found = []
    for block in model.blocks:
        if not any(block.element == element for element, _ in _ENERGIES):
            continue
        wedge = _wedges(block)
        kind = _body_of(model, block) * len(model.law) + block.material
        for k in np.flatnonzero(np.bincount(kind)):
            body, material = divmod(int(k), len(model.law))
            sigma_y = float(model.law[material, 2:3].sum()) if block.plastic else 0.0
            if block.element == "hex8r" and not sigma_y and not wedge[kind == k].any():
                continue  # they bend right
            for jumps in (False, True):
                own = np.flatnonzero((kind == k) & (wedge == jumps))
                if len(own):
                    found.append(_sample(model, block, own, body, material, jumps, sigma_y))
    return found


def _sample(
    model: Model, block: Block, own: NDArray[np.intp], body: int, material: int, wedge: bool, sigma_y: float
) -> Cells:
    """The cells to look at out of the body's `own` ones of one material and type."""
    jumps = wedge or block.element == "tet4"
    chosen = own if len(own) <= WHOLE[jumps] else own[_spread(len(own), SAMPLE[jumps])]
    cells = _with_neighbours(block.conn, chosen, own) if jumps else chosen
    K, G = model.law[material, :2]
    energies, prepare = _ENERGIES[block.element, wedge]
    share = len(own) / len(chosen)
    return Cells(body, energies, block.conn[:, cells].T, len(chosen), K, G, sigma_y, share, model.X, prepare)


def _spread(total: int, count: int) -> NDArray[np.intp]:
    """So many numbers below `total`, one at a varying place of each equal part: even steps would follow the layers."""
    k = np.arange(count)
    return np.floor((k + k * GOLDEN % 1.0) * (total / count)).astype(np.intp)


def _wedges(block: Block) -> NDArray[np.bool_]:
    """Which cells of a block are wedges, shape (element_count,)."""
    if len(block.conn) != HEXAHEDRON.corners:
        return np.zeros(block.conn.shape[1], dtype=bool)
    found = block.conn[2] == block.conn[3]  # a quick first look
    found[found] = cell_names(block.conn[:, found].T) == WEDGE.name
    return found


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
    before = before if before.shape == found.shape else np.zeros_like(found)
    more = found[:, SPENT, None] > before[:, SPENT, None]  # not-a-number is not greater
    return np.where(more, found, before)


def bending_warnings(model: Model, bent: Array, exchanged: float, energy: float, struck: bool = False) -> Iterator[str]:
    """A sentence for each body whose cells do not bend right.

    Args:
        model: of the scene alone.
        bent: energies of its bodies, as `SceneRecords.stiffened` has them; empty without cells that can be so.
        exchanged: energy that bodies exchanged [J].
        energy: greatest of all energy that there was [J].
        struck: whether bodies touched.
    """
    for name, sums in zip(model.element_start, bent, strict=False):
        if sums[SPENT] > max(LEAST * exchanged, FREE * energy) and (found := _said(model, name, sums, struck)):
            yield found


def _said(model: Model, name: str, sums: Array, struck: bool) -> str:
    """What cells do to the bending of the body with these `sums`; empty where that is right."""
    elements, wedge, yields = _kinds(model, name)
    error = sums[RIGHT] / sums[SPENT] - 1.0
    limit = STRUCK if struck else JUMPING if wedge or "tet4" in elements else ERROR
    found = []
    if -error > limit or (error > limit and sums[BENT] > SINGLE * sums[SPENT]):
        flexible = "flexible in bending, its deflections" if error > 0.0 else "stiff in bending, its deflections"
        jumps = "in jumps of strain between cells" if wedge or "tet4" in elements else ""
        single = "in bending of single cells" if elements != {"tet4"} else ""
        found.append(
            f"{' and '.join(sorted(elements))} makes {name} too {flexible} about {abs(error):.0%} too "
            f"{'large' if error > 0.0 else 'small'}: {sums[BENT] / sums[SPENT]:.0%} of the strain energy of {name} lay "
            f"{' and '.join(filter(None, (single, jumps)))} when it was greatest"
        )
    flow = sums[FLOWING] / sums[FLOW] if sums[FLOW] > 0.0 else 1.0
    if abs(flow - 1.0) > (STRUCK if struck else PLASTIC):
        found.append(
            f"cells of {name} yield too {'early' if flow < 1.0 else 'late'} in bending, at about {flow:.2f} times the "
            "plastic moment"
        )
    if sums[MISSED] > MISSING * sums[SPENT]:
        found.append(
            f"hex8r does not let {name} yield where bending of single cells alone exceeds the yield stress: "
            "deflections and plastic work are too small"
        )
    return f"{'; '.join(found)}; {_remedy(elements, wedge, yields)}" if found else ""


def _remedy(elements: set[str], wedge: bool, yields: bool) -> str:
    """What makes a body of such cells bend right: hex8r only where nothing yields."""
    layers = "four or more cells over the thickness, no longer than deep"
    if wedge or "tet4" in elements:
        return f"choose smaller cells, or hexahedra, {layers if yields else 'with hex8r'}"
    return f"take {layers}" if yields else f"choose hex8r, or {layers}"


def _kinds(model: Model, name: str) -> tuple[set[str], bool, bool]:
    """Elements of a body, whether some are wedges, and whether its material can yield."""
    elements, wedge, yields = set(), False, False
    number = list(model.element_start).index(name)
    for block in model.blocks:
        own = _body_of(model, block) == number
        if own.any():
            elements.add(block.element)
            wedge = wedge or bool(_wedges(block)[own].any())
            yields = yields or block.plastic
    return elements, wedge, yields


def _body_of(model: Model, block: Block) -> NDArray[np.intp]:
    """Number of the body of each element of a block, in the order of `Model.element_start`."""
    own = model.element_of[block.first : block.first + block.conn.shape[1]]
    start = np.array(list(model.element_start.values()))
    order = np.argsort(start, kind="stable")
    return order[np.searchsorted(start[order], own, side="right") - 1]
