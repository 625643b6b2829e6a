"""Owns the search for the cells of a mesh that hold given points, and the shape functions there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.geometry import tetrahedron
from warp_mca.geometry.boxes import Boxes, cell_boxes
from warp_mca.geometry.cell_types import HEXAHEDRON, MAX_CORNERS, TETRAHEDRON, linear_type
from warp_mca.geometry.hexahedron import shape_functions
from warp_mca.geometry.inertia_brick import corner_weights
from warp_mca.geometry.mesh import Mesh

CANDIDATES = 64  # candidate cells for each point: the centres of long thin cells are far away
CONVERGED = 1e-12  # change of natural coordinates after which Newton's method ends
FLAT = 1e-12  # determinant of a Jacobian over the product of its columns' lengths, up to which it has no inverse
OUTSIDE = 0.05  # share of a cell's diagonal by which a point may lie outside: faces on curved surfaces are flat

# For each point: nodes of its cell, shape (point_count, MAX_CORNERS), int32; shape functions there [-], of that shape;
# distance between point and cell [m], and the largest distance at which the point still counts as inside [m], both
# shape (point_count,).
Located = tuple[Index, Array, Array, Array]


def _nearest(at: Array, points: Array, cells: Index, boxes: Boxes) -> NDArray[np.intp]:
    """The cells whose centres lie nearest to each point, shape (point_count, candidate_count).

    Only cells whose boxes lie beside the points are searched, or all where there are none, so that the distance from
    the nearest one is known.
    """
    from scipy.spatial import KDTree

    lower, upper = boxes
    margin = OUTSIDE * np.linalg.norm(upper - lower, axis=0)
    beside = (lower - margin > at.max(axis=0)[:, None]) | (upper + margin < at.min(axis=0)[:, None])
    index = np.flatnonzero(~beside.any(axis=0))
    index = index if len(index) else np.arange(len(cells))
    _, near = KDTree(points[cells[index]].mean(axis=1)).query(at, k=min(CANDIDATES, len(index)))
    return index[np.asarray(near).reshape(len(at), -1)]


def in_hexahedra(at: Array, points: Array, cells: Index, boxes: Boxes) -> Located:
    """The hexahedron around or nearest to each point.

    Args:
        at: the points [m], shape (point_count, 3).
        points: positions of the nodes [m], shape (node_count, 3).
        cells: nodes of the hexahedra, shape (cell_count, 8).
        boxes: around the cells, from `cell_boxes`.
    """
    near = _nearest(at, points, cells, boxes)
    lower, upper = boxes[0][:, near], boxes[1][:, near]  # (axis, point, candidate)
    # No point of an element is nearer than its box: few candidates remain.
    gap = np.linalg.norm(at.T[..., None] - np.clip(at.T[..., None], lower, upper), axis=0)
    apart, weight = np.full(near.shape, np.inf), np.zeros((*near.shape, HEXAHEDRON.corners))
    round_off = 1e-12 * (upper.max() - lower.min())
    tried = gap <= gap.min(axis=1, keepdims=True) + round_off
    while tried.any():
        corners = points[cells[near[tried]]]
        weight[tried], apart[tried] = _weights(np.repeat(at, tried.sum(axis=1), axis=0), corners)
        tried = np.isinf(apart) & (gap <= apart.min(axis=1, keepdims=True) + round_off)
    alike = apart <= apart.min(axis=1, keepdims=True) + round_off  # a point on a face: the first of its cells
    best, rows = np.where(alike, near, len(cells)).argmin(axis=1), np.arange(len(at))
    allowed = OUTSIDE * np.linalg.norm((upper - lower)[:, rows, best], axis=0)
    return cells[near[rows, best]], weight[rows, best], apart[rows, best], allowed


def _weights(at: Array, x: Array) -> tuple[Array, Array]:
    """Shape functions at the place in a hexahedron nearest to a point, shape (count, 8), and its distance [m]."""
    xi = np.zeros_like(at)
    value, slope = shape_functions(xi)
    missing = at - (value[:, None] @ x)[:, 0]
    for _ in range(8):  # Newton's method on x(xi) = at, kept within the element
        before = xi
        xi = np.clip(xi + _solved((slope.transpose(0, 2, 1) @ x).transpose(0, 2, 1), missing), -1.0, 1.0)
        value, slope = shape_functions(xi)
        missing = at - (value[:, None] @ x)[:, 0]
        if np.abs(xi - before).max(initial=0.0) <= CONVERGED:
            break
    return value, np.linalg.norm(missing, axis=-1)


def _solved(J: Array, right: Array) -> Array:
    """Least x with J x = right, each shape (count, 3); J, shape (count, 3, 3), may have no inverse.

    It has none where corners of a wedge or a pyramid coincide.
    """
    flat = np.abs(np.linalg.det(J)) <= FLAT * np.linalg.norm(J, axis=1).prod(axis=1)
    if not flat.any():
        return np.linalg.solve(J, right[..., None])[..., 0].astype(np.float64, copy=False)
    found = np.empty_like(right)
    found[~flat] = np.linalg.solve(J[~flat], right[~flat, :, None])[..., 0]
    found[flat] = (np.linalg.pinv(J[flat]) @ right[flat, :, None])[..., 0]
    return found


def in_tetrahedra(at: Array, points: Array, cells: Index, boxes: Boxes) -> Located:
    """The tetrahedron around or nearest to each point; arguments as in `in_hexahedra`.

    Beyond its four corners the last one is repeated with weight 0.
    """
    near = _nearest(at, points, cells, boxes)
    x = points[cells[near]]
    slope = tetrahedron.gradients(x.reshape(-1, 4, 3)).reshape(x.shape)
    weight = np.einsum("pcai,pci->pca", slope, at[:, None] - x.mean(axis=2)) + 0.25
    weight = np.clip(weight, 0.0, None)
    weight /= weight.sum(axis=-1, keepdims=True)
    apart = np.linalg.norm(at[:, None] - np.einsum("pca,pcai->pci", weight, x), axis=-1)
    best, rows = apart.argmin(axis=1), np.arange(len(at))
    allowed = OUTSIDE * np.linalg.norm(np.ptp(x[rows, best], axis=1), axis=1)
    missing = (0, 0), (0, MAX_CORNERS - TETRAHEDRON.corners)
    nodes = np.pad(cells[near[rows, best]], missing, mode="edge")
    return nodes, np.pad(weight[rows, best], missing), apart[rows, best], allowed


LOCATE: dict[str, Callable[[Array, Array, Index, Boxes], Located]] = {
    HEXAHEDRON.name: in_hexahedra,
    TETRAHEDRON.name: in_tetrahedra,
}  # by stored cell type


def around_point(field: str, body: str, place: Array, mesh: Mesh, inertia: bool = False) -> tuple[Index, Array]:
    """The corners of the cell around a point of a body [m], shape (3,), with its shape functions there as weights.

    Of a body that is an `inertia` without geometry the point may lie anywhere.

    Raises:
        RequestError: the point, of the named field, lies outside the body, or too far from an inertia.
    """
    if inertia:
        return corner_weights(field, body, place, mesh)
    at = place[None]
    found = []
    for name, cells in mesh.cells.items():
        if len(cells):
            linear = linear_type(name)
            corners = cells[:, : linear.corners]
            found.append(LOCATE[linear.name](at, mesh.points, corners, cell_boxes(mesh.points, corners)))
    corner, weight, apart, allowed = min(found, key=lambda cell: float(cell[2][0] - cell[3][0]))
    if apart[0] > allowed[0]:
        remedy = f"this point lies {apart[0]:.3g} m outside the body {body}; give one of it, in its own frame"
        raise bad_value(field, tuple(place.tolist()), remedy)
    kept = weight[0] != 0.0
    return corner[0][kept].astype(np.int32), weight[0][kept]


def weighted_set(node: Index, mass: Array) -> tuple[Index, Array]:
    """The nodes of a set, weighted with their part of the `mass` of a body's nodes; slaves of ties have none."""
    weight = mass[node] if mass[node].any() else np.ones(len(node))
    return node.astype(np.int32), weight / weight.sum()
