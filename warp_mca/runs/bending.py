"""Owns what the shape of bodies says of bending in a run: strain energy that cells too long or too few spend on it.

A trilinear hexahedron of all integration points cannot bend without shear: displacements u_j = q xi_j xi_k along its
edge j give the strain q xi_k / a_j that bending asks for, and a shear q xi_j / a_k that it does not. Linear tetrahedra
bend in steps: their strain jumps from cell to cell about the mean of neighbours.
Parasitic shear: Hughes, The Finite Element Method (1987), section 4.4; jumps about recovered strain: Zienkiewicz and
Zhu, Int. J. Numer. Meth. Engng 24 (1987) 337.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.hexahedron import CORNERS
from warp_mca.geometry.tetrahedron import gradients, volumes

if TYPE_CHECKING:
    from warp_mca.model.assembly import Block
    from warp_mca.model.model import Model

Array = NDArray[np.float64]

SHARE = 0.2  # of a body's strain energy from which on a word is said: bending frequencies are then 12 % too high
# Cells of a body up to which all are looked at, and how many, evenly spread, of more: tetrahedra need those around them
# too, and all of 80,000 take 0.2 s.
WHOLE, SAMPLE = {"hex8": 1024, "tet4": 16_384}, {"hex8": 1024, "tet4": 256}
LEAST = 0.02  # of the energy that bodies exchanged: less strain energy says nothing
PAIRS = ((0, 1), (1, 2), (2, 0))  # of axes, in whose product a mode of bending is linear
# What positions of the corners have of the three edges, and of bending about each, shape (6, 8).
SHAPES = np.stack([*CORNERS.T, *(CORNERS[:, j] * CORNERS[:, k] for j, k in PAIRS)]) / 8.0
TURNS = 8  # of the iteration at most: rotations are exact to rounding for stretches from 0.1 to 10
LOOKS = 8  # in a run, besides that at its end


@dataclass(frozen=True)
class Bricks:
    """Hexahedra as they were, each a parallelepiped but for its modes of bending.

    Cells are the last axis, so that numpy goes through them without a stop: three times as fast as with matrices there.

    Attributes:
        X: positions of their nodes [m], shape (8, cell_count, 3), float64.
        inverse: of the halves of their edges in columns [1/m], shape (3, 3, cell_count), float64.
        edge: unit vectors along the edges, in columns [-], shape (3, 3, cell_count), float64.
        mode: what bending in each pair of axes has of X [m], shape (3, 3, cell_count), float64.
        stretches, shears: volume over the square of the half of an edge [m], by pair of axes and the edge along which
            this bending displaces, for the strain that it asks for and for the shear that comes with it, shape
            (3, 3, cell_count), float64.
        volume: [m^3], shape (cell_count,), float64.
    """

    X: Array
    inverse: NDArray[np.floating]
    edge: NDArray[np.floating]
    mode: Array
    stretches: Array
    shears: Array
    volume: Array


@dataclass(frozen=True)
class Sample:
    """Cells of one body and material that are looked at.

    Attributes:
        body: number of the body, in the order of `Model.element_start`.
        energies: that finds what they spend, of displacements and this.
        conn: their nodes, shape (cell_count, corner_count), int32; of tetrahedra, those next to them follow.
        looked_at: how many of `conn` are looked at.
        K, G: bulk and shear modulus [Pa].
        share: cells of the body and material over those looked at [-].
        X: positions of all nodes [m], shape (node_count, 3), float64.
    """

    body: int
    energies: Callable[[Array, Sample], tuple[float, float]]
    conn: NDArray[np.int32]
    looked_at: int
    K: float
    G: float
    share: float
    X: Array

    @cached_property
    def bricks(self) -> Bricks:
        """The cells, which are hexahedra; found at the first look, while a GPU computes steps."""
        return bricks_of(self.X[self.conn.T])


def samples_of(model: Model) -> list[Sample]:
    """Cells of a scene's model that are looked at."""
    found = []
    for block in model.blocks:
        if block.element not in _ENERGIES:
            continue
        kind = _body_of(model, block) * len(model.law) + block.material
        for k in np.flatnonzero(np.bincount(kind)):
            own = np.flatnonzero(kind == k)
            chosen = own if len(own) <= WHOLE[block.element] else own[:: -(-len(own) // SAMPLE[block.element])]
            cells = chosen if block.element == "hex8" else _with_neighbours(block.conn, chosen, own)
            body, material = divmod(int(k), len(model.law))
            K, G = model.law[material, :2]
            conn, energies = block.conn[:, cells].T, _ENERGIES[block.element]
            found.append(Sample(body, energies, conn, len(chosen), K, G, len(own) / len(chosen), model.X))
    return found


def _with_neighbours(conn: NDArray[np.int32], chosen: NDArray[np.intp], own: NDArray[np.intp]) -> NDArray[np.intp]:
    """Chosen cells, then those of their `own` body that share a node with one of them."""
    near = np.zeros(int(conn.max()) + 1, dtype=bool)
    near[conn[:, chosen]] = True
    beside = near[conn[0, own]] | near[conn[1, own]] | near[conn[2, own]] | near[conn[3, own]]
    beside[np.searchsorted(own, chosen)] = False
    return np.concatenate([chosen, own[beside]])


def seen(model: Model, samples: list[Sample], u: Array, before: Array) -> Array:
    """Energies of each body as `SceneRecords.stiffened` has them, of the shape with more strain energy.

    Args:
        model: of the scene alone.
        samples: its cells that are looked at.
        u: displacements [m], shape (node_count, 3), float64.
        before: what was seen before, shape (body_count, 2), float64, or empty.
    """
    found = _energies(model, samples, u)
    before = before if len(before) else np.zeros_like(found)
    return np.where(found[:, 1:] > before[:, 1:], found, before)  # not-a-number is not greater


def bending_warnings(model: Model, stiffened: Array, exchanged: float) -> Iterator[str]:
    """A sentence for each body whose cells bend too stiffly, of the scene alone, which exchanged so much energy [J]."""
    if not len(stiffened):  # no cells that can be so
        return
    element = {name: block.element for block in model.blocks for name in _bodies(model, block)}
    for name, (wasted, energy) in zip(model.element_start, stiffened, strict=True):
        if energy > LEAST * exchanged and wasted > SHARE * energy:
            yield (
                f"{wasted / energy:.0%} of the strain energy of {name} lay {_WHERE[element[name]]} when it was "
                "greatest: the body is about that much too stiff, as it moved then; choose hex8r, or smaller cells"
            )


def _bodies(model: Model, block: Block) -> list[str]:
    """Names of the bodies that have elements in a block."""
    names = np.array(list(model.element_start))
    return names[np.unique(_body_of(model, block))].tolist()


def _body_of(model: Model, block: Block) -> NDArray[np.intp]:
    """Number of the body of each element of a block, in the order of `Model.element_start`."""
    own = model.element_of[block.first : block.first + block.conn.shape[1]]
    start = np.array(list(model.element_start.values()))
    order = np.argsort(start, kind="stable")
    return order[np.searchsorted(start[order], own, side="right") - 1]


@np.errstate(all="ignore")  # what is not a number is not above a share
def _energies(model: Model, samples: list[Sample], u: Array) -> Array:
    """Of each body, energy that its cells spend so and strain energy of those looked at [J], shape (body_count, 2)."""
    found = np.zeros((len(model.element_start), 2))
    if not np.isfinite(u).all():
        return found
    for item in samples:
        wasted, energy = item.energies(u, item)
        found[item.body] += item.share * wasted, item.share * energy
    return found


def _turned_back(F: Array) -> tuple[Array, Array]:
    """Rotation R of each gradient F of the motion and the strain of R^T F, shape (3, 3, count) all."""
    R = F
    for _ in range(TURNS):  # Newton's iteration of the polar decomposition: Higham, SIAM J. Sci. Stat. Comput. 7 (1986)
        cofactor = _cofactors(R)
        closer = 0.5 * (R + cofactor / np.einsum("jn,jn->n", R[0], cofactor[0]))
        change, R = np.abs(closer - R).max(initial=0.0), closer
        if change < 1e-8:  # the next one would change it by the square of that
            break
    stretch = np.einsum("kin,kjn->ijn", R, F)
    return R, 0.5 * (stretch + stretch.transpose(1, 0, 2)) - np.eye(3)[:, :, None]


def _cofactors(A: Array) -> Array:
    """Of each matrix, shape (3, 3, count)."""
    after, last = [1, 2, 0], [2, 0, 1]
    B, C = A[after], A[last]
    return B[:, after] * C[:, last] - B[:, last] * C[:, after]


def _shapes(x: Array) -> Array:
    """What positions x of corners, shape (8, cell_count, 3), have of SHAPES, shape (6, 3, cell_count)."""
    found = (SHAPES @ x.reshape(8, -1)).reshape(6, -1, 3)
    return np.ascontiguousarray(found.transpose(0, 2, 1))


def _hexahedra(u: Array, sample: Sample) -> tuple[float, float]:
    """Energy in parasitic shear and all strain energy [J] of the cells that are looked at."""
    K, G, bricks = sample.K, sample.G, sample.bricks
    shapes = _shapes(bricks.X + u[sample.conn.T])
    R, strain = _turned_back(np.einsum("kin,kjn->ijn", shapes[:3], bricks.inverse))
    q = np.einsum("ijn,min->mjn", R, shapes[3:]) - bricks.mode
    square = np.einsum("mjn,jan->man", q, bricks.edge) ** 2
    E = 9.0 * K * G / (3.0 * K + G)
    theta = np.einsum("iin->n", strain)
    energy = (0.5 * K - G / 3.0) * theta**2 + G * np.einsum("ijn,ijn->n", strain, strain)
    wasted = G * np.vdot(square, bricks.shears) / 6.0  # 1 / 2 of the mean over the cell of (strain xi)^2
    stretched = E * np.vdot(square, bricks.stretches) / 6.0
    return float(wasted), float(np.vdot(bricks.volume, energy) + stretched + wasted)


def bricks_of(X: Array) -> Bricks:
    """What displacements do not change of hexahedra with these nodes [m], shape (8, cell_count, 3)."""
    shapes = _shapes(X)
    T = shapes[:3].transpose(2, 1, 0)  # columns: halves of the edges
    half, volume = np.linalg.norm(T, axis=1).T, 8.0 * np.abs(np.linalg.det(T))
    stretches, shears = np.zeros_like(shapes[3:]), np.zeros_like(shapes[3:])
    for pair, (j, k) in enumerate(PAIRS):
        for a, b in ((j, k), (k, j)):
            stretches[pair, a], shears[pair, a] = volume / half[a] ** 2, volume / half[b] ** 2
    inverse, edge = (np.ascontiguousarray(A.transpose(1, 2, 0)) for A in (np.linalg.inv(T), T / half.T[:, None]))
    return Bricks(X, inverse, edge, shapes[3:], stretches, shears, volume)


def _tetrahedra(u: Array, sample: Sample) -> tuple[float, float]:
    """Energy in jumps of strain between cells and all strain energy [J] of the cells that are looked at."""
    X, conn, own = sample.X, sample.conn, slice(sample.looked_at)
    volume = np.abs(volumes(X[conn]))
    _, strain = _turned_back(np.eye(3)[:, :, None] + np.einsum("eai,eaj->ije", u[conn], gradients(X[conn])))
    node, corner = np.unique(conn, return_inverse=True)
    corner = corner.reshape(conn.shape)
    weight = np.bincount(corner.ravel(), np.repeat(volume, 4))
    weighted = np.repeat(volume * strain.reshape(9, -1), 4, axis=1)
    total = np.stack([np.bincount(corner.ravel(), part, len(node)) for part in weighted])
    mean = (total / weight)[:, corner[own]].mean(axis=2).reshape(3, 3, -1)
    strain, volume = strain[:, :, own], volume[own]
    unit = np.eye(3)[:, :, None] / 3.0
    deviator = strain - np.einsum("iin->n", strain) * unit
    theta = np.einsum("iin->n", mean)  # tet4 takes the mean dilatation around its nodes
    energy = 0.5 * sample.K * theta**2 + sample.G * (deviator**2).sum(axis=(0, 1))
    wasted = sample.G * ((deviator - mean + theta * unit) ** 2).sum(axis=(0, 1))
    return float((volume * wasted).sum()), float((volume * energy).sum())


_ENERGIES = {"hex8": _hexahedra, "tet4": _tetrahedra}
_WHERE = {"hex8": "in shear that long cells of hex8 add to bending", "tet4": "in jumps of strain between cells of tet4"}
