"""Owns the boxes, with edges along the axes, around the cells of a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.base.chunks import CHUNK, chunks

Boxes = tuple[Array, Array]  # least and greatest coordinates of each cell, as from `cell_boxes`


def cell_boxes(points: Array, cells: NDArray[np.int32]) -> Boxes:
    """Least and greatest coordinates of each cell [m], each shape (3, cell_count), float64.

    Args:
        points: positions of the nodes [m], shape (node_count, 3), float64.
        cells: nodes of each, shape (cell_count, corners), int32.
    """
    lower, upper = np.empty((3, len(cells))), np.empty((3, len(cells)))
    for part in chunks(len(cells), CHUNK):
        x = np.ascontiguousarray(points[cells[part].T].transpose(2, 0, 1))
        lower[:, part], upper[:, part] = x.min(axis=1), x.max(axis=1)
    return lower, upper
