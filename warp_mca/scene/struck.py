"""Owns how fine cells are where a drop strikes: edges and corners that yield are crushed as deep as energy takes them.

Crushing to the depth d takes the work W(d), the sum over cells of yield stress times volume below d. It uses up the
energy of the fall where W(d) = m g h. W grows as d on a face, as d^1.5 on a round edge, as d^2 on an edge or a round
corner and as d^3 on a corner: the exponent tells whether the place is flat.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.rotation import rotation_matrix
from warp_mca.geometry.cad_finer import Finer
from warp_mca.scene.bodies import Body
from warp_mca.scene.extent import cell_values, in_place, mesh_of

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh

ROWS = 1.0  # cells over the crushed depth, for each one over a wall [-]
FLAT = 1.25  # exponent of W(d) up to which a place is flat [-]
# Of the contact of such bodies with the floor [-]: springs of flat faces, its default, hold much of the energy where an
# edge strikes. The shorter step is needed, too: crushed cells flatten, and became unstable with 2.
PENALTY = 10.0
FINEST = 4.0  # times smaller than the cells there, at most: steps are as many times more [-]
# Cells whose mean edge is so many times greater than those over the crushed depth would be are told of [-], 1.3 times
# as many as the size that makes them. On cells that are not finer, a round side is a corner, which is crushed up to
# three times as deep. By sizes, a ball of ABS had 11 times, and a greatest force 1 % below that of cells half as large;
# a steel cylinder on its side, 12 mm thick, had 27 times with across=1 and 38 with 2, and was 6 % above and 5 % below;
# one of aluminium, 42 times and 10 %. Balls of 40 mm in cells of 5 mm, none finer: ABS 19 times and 17 % above,
# aluminium 24 times and 22 % below; in cells of 3.3 mm 15 and 21 times, and 3 %; cylinders on their side 34 to 83 times
# and 5 % at most.
_FAR = 20.0
_SIZE = 0.7  # to ask for, over the mean edge [-]
_TOLD = (
    "the fall crushes {name} about {depth:.2g} m deep, where its cells are {size:.2g} m: its greatest force may be "
    "10 % off or more; give struck a smaller size, as {wanted:.2g} or less"
)
_WORTH = 0.7  # of their size: cells that are not smaller are left as they are [-]
_LEAST, _MOST = 1e-5, 0.2  # depths over the height of the parts, below which all is flat and above which none is [-]
_APART = 1e-5  # of the height of a cell, by which corners at one height are taken apart [-]
_STEP, _HALVINGS = 1.02, 60  # of the depth, for the exponent [-]; of the interval in which it lies


def finer_where_struck(
    bodies: Sequence[Body], meshes: Sequence[Mesh], energy: float, struck: float | str
) -> list[Body]:
    """Bodies above the floor z = 0, with finer cells and strains taken as large where they strike it; [] if all stay.

    Those whose cells are coarse there say so.

    Args:
        bodies: in their places.
        meshes: of these.
        energy: of the fall [J].
        struck: size of cells there [m], "auto" or "off", as in `drop_test`.
    """
    from warp_mca.geometry.cad import Cad

    if not any(isinstance(body.geometry, Cad) for body in bodies):
        return []
    looked = _looked_at(bodies, meshes, energy)
    found = [_finer(body, looked, struck) for body in bodies]
    if any(one is not other for one, other in zip(found, bodies, strict=True)):
        looked = _looked_at(found, [mesh_of(body) for body in found], energy)
    found = [_told(body, looked) for body in found]
    return [] if all(one is other for one, other in zip(found, bodies, strict=True)) else found


def _looked_at(bodies: Sequence[Body], meshes: Sequence[Mesh], energy: float) -> _Looked:
    """Where bodies in their places strike with an energy [J]."""
    from warp_mca.geometry.cad import Cad

    pairs = list(zip(bodies, meshes, strict=True))
    parts = {body.name: _cells(body, mesh) for body, mesh in pairs if isinstance(body.geometry, Cad)}
    lowest = min(float(in_place(body, mesh)[:, 2].min()) for body, mesh in pairs)
    heights = np.concatenate([part.heights for part in parts.values()]) - lowest
    depth, exponent = crushed_depth(heights, np.concatenate([part.work for part in parts.values()]), energy)
    return _Looked(parts, lowest, depth if exponent > FLAT else 0.0)


def _told(body: Body, looked: _Looked) -> Body:
    """A body, which says so if its cells are coarse for the crushed depth."""
    geometry: Any = body.geometry
    size = looked.size(body, looked.depth)
    most = _FAR * looked.depth / (ROWS * geometry.across)
    if not 0.0 < most < size:
        return body
    note = _TOLD.format(name=body.name, depth=looked.depth, size=size, wanted=_SIZE * most)
    return replace(body, geometry=replace(geometry, notes=(*geometry.notes, note)))


class _Cells(NamedTuple):
    """Tetrahedra of a body in its place.

    Attributes:
        heights: of their corners above the floor [m], rising, shape (cell_count, 4), float64.
        work: of crushing each of them: yield stress times volume [J], shape (cell_count,), float64.
        size: mean edge of each of them [m], shape (cell_count,), float64.
    """

    heights: Array
    work: Array
    size: Array


class _Looked(NamedTuple):
    """Where parts strike.

    Attributes:
        parts: cells of the bodies of CAD files, by name.
        lowest: height of the lowest point of all bodies [m].
        depth: that the fall crushes [m], 0 where the place is flat.
    """

    parts: dict[str, _Cells]
    lowest: float
    depth: float

    def size(self, body: Body, depth: float) -> float:
        """Mean edge of a body's cells that lie within a depth [m]; 0 if none do, and of rigid bodies."""
        cells = self.parts.get(body.name)
        if cells is None or body.rigid:
            return 0.0
        near = cells.heights[:, 0] <= self.lowest + depth
        return float(cells.size[near].mean()) if near.any() else 0.0


def _cells(body: Body, mesh: Mesh) -> _Cells:
    from warp_mca.geometry.cell_types import TETRA10, linear_type

    cells = mesh.others[TETRA10.name][:, : linear_type(TETRA10.name).corners]
    corners = in_place(body, mesh)[cells]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
    edges = [corners[:, i] - corners[:, j] for i, j in combinations(range(4), 2)]
    size = np.mean([np.linalg.norm(edge, axis=1) for edge in edges], axis=0)
    strength = np.inf if body.rigid else cell_values(body, mesh, "yield_stress")
    return _Cells(np.sort(corners[:, :, 2], axis=1), volume * strength, size)


def _finer(body: Body, looked: _Looked, struck: float | str) -> Body:
    """A body with finer cells if it is struck and they are worth it, else as it is."""
    geometry: Any = body.geometry
    depth, lowest = looked.depth, looked.lowest
    usual = looked.size(body, depth if isinstance(struck, str) else max(depth, struck))
    if not usual or struck == "off" or (struck == "auto" and (geometry.size is not None or not depth)):
        return body
    crushed, finest = depth / (ROWS * geometry.across), usual / FINEST
    size = max(crushed, finest) if isinstance(struck, str) else struck
    if size > _WORTH * usual:
        return body
    turn = rotation_matrix(np.array(body.rotation))
    above: Any = turn.T @ ((0.0, 0.0, lowest + max(depth, size)) - np.array(body.position))
    place = Finer(point=tuple(above.tolist()), normal=tuple(turn[2].tolist()), size=size)
    return replace(body, geometry=replace(geometry, finer=(*geometry.finer, place)), kinematics="finite")


def crushed_depth(heights: Array, work: Array, energy: float) -> tuple[float, float]:
    """Depth that a fall crushes [m], and the exponent of the work over the depth there; 0 and 1 where all is flat.

    Args:
        heights: of the corners of tetrahedra above the floor [m], rising, shape (cell_count, 4), float64.
        work: of crushing each of them [J], shape (cell_count,), float64.
        energy: of the fall [J].
    """
    top = float(heights.max())
    low, high = _LEAST * top, _MOST * top
    near = heights[:, 0] < _STEP * high
    heights, work = heights[near], work[near]
    if _work(heights, work, low) >= energy:
        return 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _work(heights, work, middle) >= energy else (middle, high)
    ratio = _work(heights, work, high * _STEP) / max(_work(heights, work, high / _STEP), 1e-300)
    return high, math.log(ratio) / (2.0 * math.log(_STEP)) if math.isfinite(ratio) else math.inf


def _work(heights: Array, work: Array, depth: float) -> float:
    """Of crushing tetrahedra to a depth [J]: of each that share of its volume which lies below."""
    reached = heights[:, 0] < depth
    share, work = shares_below(heights[reached], depth), work[reached]
    return float((share[share > 0.0] * work[share > 0.0]).sum())  # of what never yields the work is infinite


def shares_below(heights: Array, depth: float) -> Array:
    """Share of the volume of tetrahedra that lies below a depth [-], shape (cell_count,), float64.

    It is the divided difference of (depth - z)^3, cut off at 0, over the heights z of the corners.

    Args:
        heights: of their corners [m], rising, shape (cell_count, 4), float64; the lowest is below the depth.
        depth: height below which volume counts [m].
    """
    z = heights + _APART * (heights[:, 3:] - heights[:, :1]) * np.arange(4.0)
    share = np.zeros(len(z))
    for i in range(4):
        others = [j for j in range(4) if j != i]
        share += np.maximum(depth - z[:, i], 0.0) ** 3 / np.prod(z[:, others] - z[:, i : i + 1], axis=1)
    return np.clip(share, 0.0, 1.0)
