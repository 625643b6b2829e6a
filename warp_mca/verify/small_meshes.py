"""Owns meshes of a few cells for patch tests, distorted or of every type, and bricks of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.geometry.degenerate import stored
from warp_mca.geometry.mesh import Mesh
from warp_mca.physics.elements import ELEMENTS

Array = NDArray[np.float64]

CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)
INNER = np.array(
    [
        [0.249, 0.342, 0.192], [0.826, 0.288, 0.288], [0.850, 0.649, 0.263], [0.273, 0.750, 0.230],
        [0.320, 0.186, 0.643], [0.677, 0.305, 0.683], [0.788, 0.693, 0.644], [0.165, 0.745, 0.702],
    ]
)  # fmt: skip
PATCH = np.array(
    [
        [8, 9, 10, 11, 12, 13, 14, 15],
        [0, 1, 2, 3, 8, 9, 10, 11], [12, 13, 14, 15, 4, 5, 6, 7],
        [0, 1, 9, 8, 4, 5, 13, 12], [11, 10, 2, 3, 15, 14, 6, 7],
        [0, 8, 11, 3, 4, 12, 15, 7], [9, 1, 2, 10, 13, 5, 6, 14],
    ],
    dtype=np.int32,
)  # fmt: skip


def patch() -> Mesh:
    """The unit cube of seven distorted hexahedra [m]."""
    return Mesh(np.concatenate([CUBE, INNER]), PATCH)


def mixed_cube() -> Mesh:
    """The unit cube of 2 x 2 x 2 cells [m]: one is of pyramids and tetrahedra, two of wedges, five are hexahedra."""
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2)).build()
    points = box.points.copy()
    inside = ((points > 0.0) & (points < 1.0)).all(axis=1)
    points[inside] += [0.03, -0.05, 0.04]
    middle = points[box.hexahedra].mean(axis=1)
    corners = box.hexahedra[np.argmin(middle @ [1.0, 1.0, -1.0])]
    centre = len(points)
    points = np.vstack([points, points[corners].mean(axis=0)])
    # faces seen from inside; the last two are free, so that they may be cut in triangles
    faces = [[0, 1, 2, 3], [4, 7, 6, 5], [1, 5, 6, 2], [2, 6, 7, 3], [0, 4, 5, 1], [3, 7, 4, 0]]
    pyramids = [[*corners[face], centre] for face in faces[:4]]
    tetrahedra = [[*corners[face][pick], centre] for face in faces[4:] for pick in ([0, 1, 2], [0, 2, 3])]
    column = np.flatnonzero((middle[:, 0] > 0.5) & (middle[:, 2] > 0.5))  # cut by one plane along y
    wedges = []
    for h in box.hexahedra[column]:
        wedges += [[h[0], h[1], h[5], h[3], h[2], h[6]], [h[0], h[5], h[4], h[3], h[6], h[7]]]
    kept = [c for c in range(8) if c not in column and (box.hexahedra[c] != corners).any()]
    hexahedra = [box.hexahedra[kept]]
    for kind, cells in (("wedge", wedges), ("pyramid", pyramids)):
        hexahedra.append(stored(points, np.array(cells), kind))
    tetrahedra = stored(points, np.array(tetrahedra), "tetrahedron")
    return Mesh(points, np.concatenate(hexahedra).astype(np.int32), {}, {}, tetrahedra)


def brick(
    element: str,
    divisions: tuple[int, int, int],
    size: tuple[float, float, float],
    move: Callable[[Array], Array] | None = None,
) -> Mesh:
    """A brick with a corner at the origin and node sets as `mca.Box`, of hexahedra, or of wedges for their elements.

    Args:
        element: formulation that will compute it.
        divisions: cells along x, y, z; a cell of wedges is cut in two along z.
        size: lengths along x, y, z [m].
        move: positions [m], shape (node_count, 3), float64 -> those that nodes take instead.
    """
    mesh = mca.Box(size=size, divisions=divisions).build()
    if move is not None:
        mesh = replace(mesh, points=move(mesh.points.copy()))
    if ELEMENTS[element].cell != "wedge":
        return mesh
    h = mesh.hexahedra
    halves = np.concatenate([h[:, [0, 1, 2, 4, 5, 6]], h[:, [0, 2, 3, 4, 6, 7]]])
    return replace(mesh, hexahedra=stored(mesh.points, halves, "wedge"), cell_sets={})
