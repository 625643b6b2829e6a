"""Owns measures of mesh quality, and the check that no element is inverted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mca.element import jacobians
from warp_mca.errors import RequestError
from warp_mca.geometry.mesh import Mesh

# The three neighbours of each corner, ordered so that the edges towards them are right-handed.
_NEIGHBOURS = np.array([[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]])
_EDGES = np.array([[0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3], [1, 2, 3, 0, 5, 6, 7, 4, 4, 5, 6, 7]])


def corner_edges(mesh: Mesh) -> NDArray[np.float64]:
    """Edges from each corner of each element to its three neighbours [m], shape (element_count, 8, 3, 3)."""
    corners = mesh.points[mesh.hexahedra]
    return corners[:, _NEIGHBOURS] - corners[:, :, None, :]


def scaled_jacobian(mesh: Mesh) -> NDArray[np.float64]:
    """Least determinant of the three unit edges over the corners of each element [-], shape (element_count,).

    1 is a brick, 0 a flat corner, below 0 an inverted one.
    """
    edges = corner_edges(mesh)
    length = np.linalg.norm(edges, axis=-1, keepdims=True)
    return np.linalg.det(edges / np.where(length > 0.0, length, 1.0)).min(axis=1)


def gauss_jacobians(mesh: Mesh) -> NDArray[np.float64]:
    """Jacobian determinants at the 2 x 2 x 2 Gauss points [m^3], shape (element_count, 8)."""
    return np.linalg.det(jacobians(mesh.points[mesh.hexahedra]))


def volumes(mesh: Mesh) -> NDArray[np.float64]:
    """Volume of each element by 8-point Gauss quadrature [m^3], shape (element_count,)."""
    return gauss_jacobians(mesh).sum(axis=1)


def edge_lengths(mesh: Mesh) -> NDArray[np.float64]:
    """Lengths of the twelve edges of each element [m], shape (element_count, 12)."""
    corners = mesh.points[mesh.hexahedra]
    return np.linalg.norm(corners[:, _EDGES[1]] - corners[:, _EDGES[0]], axis=-1)


def check(mesh: Mesh, name: str) -> None:
    """Refuses a mesh with an inverted element.

    Args:
        mesh: the mesh of one body.
        name: the body, for the message.

    Raises:
        RequestError: the Jacobian determinant is not positive at some corner or Gauss point of an element.
    """
    good = (np.linalg.det(corner_edges(mesh)) > 0.0).all(axis=1) & (gauss_jacobians(mesh) > 0.0).all(axis=1)
    bad = np.flatnonzero(~good)
    if len(bad):
        raise RequestError(
            f"body {name}: {len(bad)} of {len(good)} elements are inverted, first element {bad[0]}: "
            "repair the mesh or change the recipe's values"
        )
