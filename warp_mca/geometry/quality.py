"""Owns measures of mesh quality, and the checks that a mesh is whole and no element is inverted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.geometry.cell_types import CELL_TYPES, linear_type
from warp_mca.geometry.inertia_brick import CARRIERS
from warp_mca.geometry.mesh import Mesh

_KEEP_ONE = "keep one of them (gmsh's format 2.2 writes a cell once for each of its physical groups, 4.1 does not)"


def _corner_volumes(mesh: Mesh) -> list[NDArray[np.float64]]:
    """Determinants of the three unit edges at each corner of the cells of each stored type [-].

    1 where edges collapsed, as in wedges and pyramids.
    """
    found = []
    for name, cells in mesh.cells.items():
        linear = linear_type(name)
        neighbours, cells = np.array(linear.neighbours), cells[:, : linear.corners]
        corners = mesh.points[cells]
        edges = corners[:, neighbours] - corners[:, :, None, :]
        length = np.linalg.norm(edges, axis=-1, keepdims=True)
        volume = np.linalg.det(edges / np.where(length > 0.0, length, 1.0))
        near = cells[:, neighbours]
        collapsed = (length[..., 0] == 0.0).any(axis=-1) | (np.diff(np.sort(near, axis=-1), axis=-1) == 0).any(axis=-1)
        found.append(np.where(collapsed, 1.0, volume))
    return found


def scaled_jacobian(mesh: Mesh) -> NDArray[np.float64]:
    """Least determinant of the three unit edges over the corners of each cell [-], shape (cell_count,).

    1 is a brick, 0 a flat corner, below 0 an inverted one; at a corner of a regular tetrahedron it is 0.71.
    """
    return np.concatenate([part.min(axis=1, initial=1.0) for part in _corner_volumes(mesh)])


def volumes(mesh: Mesh) -> NDArray[np.float64]:
    """Volume of each cell [m^3], shape (cell_count,); not to be written to."""
    return mesh.cell_volumes


def edge_lengths(mesh: Mesh) -> NDArray[np.float64]:
    """Lengths of the edges of all cells [m], shape (edge_count,), without those that collapsed."""
    found = []
    for name, cells in mesh.cells.items():
        first, second = np.array(CELL_TYPES[name].edges).T
        corners = mesh.points[cells]
        found.append(np.linalg.norm(corners[:, second] - corners[:, first], axis=-1).ravel())
    length = np.concatenate(found)
    return length[length > 0.0]


def doubled_nodes(mesh: Mesh) -> int:
    """Number of nodes of the boundary that lie within a millionth of the shortest edge of one before them."""
    places = mesh.points[np.unique(mesh.boundary[0])]
    grid = np.rint((places - places.min(axis=0)) / (1e-6 * edge_lengths(mesh).min())).astype(np.int64)
    grid = grid[np.lexsort(grid.T)]
    return int((grid[1:] == grid[:-1]).all(axis=1).sum())


def pieces(mesh: Mesh) -> int:
    """Number of parts of a mesh that share no node."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = [cells[:, [0, k]] for cells in mesh.cells.values() for k in range(1, cells.shape[1]) if len(cells)]
    a, b = np.concatenate(ends).T
    count = len(mesh.points)
    _, label = connected_components(
        coo_array((np.ones(len(a), dtype=bool), (a, b)), shape=(count, count)), directed=False
    )
    return len(np.unique(label[a]))


def check(mesh: Mesh, name: str) -> None:
    """Raise RequestError for a mesh that is incomplete or has cells that are inverted or overlap.

    Hexahedra are judged where they are integrated: a corner may be folded over a little, as in patch tests.

    Args:
        mesh: the mesh of one body.
        name: the body, for the message.

    Raises:
        RequestError: as in `check_whole`; or the Jacobian determinant of a hexahedron is not positive at some Gauss
            point, or the volume of a tetrahedron is not; or two cells lie on the same side of a face of both.
    """
    check_whole(mesh, name)
    good = mesh.least_jacobians > 0.0
    bad = np.flatnonzero(~good)
    if len(bad):
        raise RequestError(
            f"body {name}: {len(bad)} of {len(good)} elements are inverted, first element {bad[0]}: "
            "repair the mesh or change the recipe's values"
        )
    if len(mesh.overlapping):
        remedy = "these two cells lie on the same side of a face of both, so that they overlap; leave one of them out"
        raise bad_value(f"body {name}: Mesh cells", mesh.overlapping.tolist(), remedy)


def check_whole(mesh: Mesh, name: str) -> None:
    """Raise RequestError for arrays that do not make a mesh: they would fail later, or count mass and stiffness twice.

    Args:
        mesh: the mesh of one body.
        name: the body, for the message.

    Raises:
        RequestError: an array has another shape or type than `Mesh` says, there is no cell, a cell or a set counts
            beyond the end, a node is in no cell or in a set twice, or two cells have the same corners.
    """
    points = mesh.points
    whole = _is_array(points, "f", 2) and points.shape[1] == 3 and points.itemsize in (4, 8)
    if not whole or not np.isfinite(points).all():
        remedy = "give three finite coordinates for each node, as float64"
        raise bad_value(f"body {name}: Mesh.points", _what(points), remedy)
    used = np.zeros(len(points), dtype=bool)
    for cell, nodes in mesh.cells.items():
        owner, corners = f"body {name}: Mesh.{CELL_TYPES[cell].field or cell}", CELL_TYPES[cell].corners
        if not _is_array(nodes, "iu", 2) or nodes.shape[1] != corners:
            raise bad_value(owner, _what(nodes), f"give the {corners} nodes of each cell, as int32")
        _check_indices(owner, nodes, len(points), "nodes")
        used[nodes] = True
        twice = _repeated(nodes)
        if twice:
            raise bad_value(owner, list(twice), f"these two cells have the same corners; {_KEEP_ONE}")
    if not mesh.cell_count:
        raise bad_value(f"body {name}: Mesh.hexahedra", 0, "give at least one cell")
    if isinstance(mesh.node_sets, Mapping):
        used[mesh.node_sets.get(CARRIERS, [])] = True  # these carry a mass that a body was given
    if not used.all():
        idle = int(np.argmin(used))
        raise bad_value(f"body {name}: Mesh.points", idle, "this node is in no cell; leave it out of the mesh")
    ratio = mesh.volume_ratio
    if not (_is_array(ratio, "f", 1) and len(ratio) in (0, 1, mesh.cell_count) and (ratio > 0.0).all()):
        remedy = f"give a positive number for each of the {mesh.cell_count} cells or one for all, or leave it out"
        raise bad_value(f"body {name}: Mesh.volume_ratio", _what(ratio), remedy)
    for kind, sets, count in (("node", mesh.node_sets, len(points)), ("cell", mesh.cell_sets, mesh.cell_count)):
        owner = f"body {name}: Mesh.{kind}_sets"
        if not isinstance(sets, Mapping):
            raise bad_value(owner, _what(sets), f"give a dict of names and {kind} indices")
        for key, members in sets.items():
            if not (kind == "cell" and _is_array(members, "b", 1) and len(members) == count):  # that is a mask
                _check_set(f"{owner}[{key!r}]", members, count, kind)


def _check_set(owner: str, members: NDArray, count: int, kind: str) -> None:
    if not _is_array(members, "iu", 1):
        remedy = f"give {kind} indices as a flat int32 array, np.flatnonzero(mask) for a mask"
        raise bad_value(owner, _what(members), remedy)
    _check_indices(owner, members, count, f"{kind}s")
    ordered = np.sort(members)
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    if kind == "node" and len(twice):
        raise bad_value(owner, int(twice[0]), "this node is in the set twice; give np.unique of it")


def _is_array(value: object, kinds: str, dimensions: int) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in kinds and value.ndim == dimensions


def _what(value: object) -> str:
    return f"{value.dtype}, shape {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__


def _check_indices(owner: str, indices: NDArray, count: int, what: str) -> None:
    if indices.size and (indices.min() < 0 or indices.max() >= count):
        wrong = int(indices.min() if indices.min() < 0 else indices.max())
        raise bad_value(owner, wrong, f"the mesh has {count} {what}, counted from 0")


def _repeated(nodes: NDArray) -> tuple[int, int] | None:
    """The first two cells with the same corners, in whichever order."""
    if not len(nodes):
        return None
    # Sums of random words do not depend on the order of corners, and differ almost surely; rows need no sorting.
    word = np.random.default_rng(1).integers(0, 2**64, int(nodes.max()) + 1, dtype=np.uint64)
    key = np.zeros(len(nodes), dtype=np.uint64)
    for corner in nodes.T:
        key += word[corner]
    order = np.argsort(key, kind="stable")
    for i in np.flatnonzero(key[order[1:]] == key[order[:-1]]):
        one, other = int(order[i]), int(order[i + 1])
        if sorted(nodes[one]) == sorted(nodes[other]):
            return one, other
    return None
