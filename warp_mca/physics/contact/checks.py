"""Owns the check that no body lies where it would pass between the slave nodes of a contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.geometry.face_projection import project

if TYPE_CHECKING:
    from warp_mca.physics.contact.surfaces import Faces


FLAT = 1e-6  # of the width of a surface, as thin as which it is flat
INNER = np.arange(1, 8) / 8.0  # places along an edge that are looked at
CLEARLY = 0.05  # of a width, by which an edge comes nearer to the other body than its ends do
NEAREST = 0.25  # of a width beyond the gap between two bodies: parts so near are those that meet first


def check_spacing(sides: tuple[str, str], two_way: bool, X: Array, slave: Faces, master: Faces | None) -> None:
    """Raise RequestError if bodies are about to pass between slave nodes: only nodes are kept out of the master.

    Each edge that is longer than the other body is wide counts by itself: where the bodies lie nearest to each other,
    none may come nearer between its ends than at them. What comes near in a run is the matter of `watch.passing`.

    Args:
        sides: bodies of the slave and the master of a contact.
        two_way: as in `Contact`.
        X: positions [m], shape (node_count, 3).
        slave, master: its surfaces; None for a plane.

    Raises:
        RequestError: such an edge is there; in two-way contact, one of each side.
    """
    if master is None:
        return
    found = _unseen(X, slave, master)
    if found and (not two_way or _unseen(X, master, slave)):
        length, width = found
        raise bad_value(
            f"Contact.slave.body {sides[0]}: distance between nodes [m]",
            float(f"{length:.4g}"),
            f"body {sides[1]} is {width:.4g} m wide and could pass between the nodes unseen: refine the "
            "mesh of the slave, or make the finer body the slave",
        )


def _unseen(X: Array, side: Faces, other: Faces) -> tuple[float, float] | None:
    """Length of an edge that the other surface passes between its ends, and its width [m], if there is one."""
    width = _least_width(X, other)
    ends = np.unique(np.sort(np.stack([side.node, np.roll(side.node, -1, axis=1)], axis=-1).reshape(-1, 2)), axis=0)
    length = np.linalg.norm(X[ends[:, 0]] - X[ends[:, 1]], axis=1)
    ends = ends[length > width]
    if not len(ends):
        return None
    start, stop = X[ends[:, 0], None], X[ends[:, 1], None]
    along = np.concatenate([start, start + INNER[:, None] * (stop - start), stop], axis=1)
    nodes = X[side.nodes]
    gap = float(min(_distance(nodes, X, other, width).min(), (apart := _distance(along, X, other, width)).min()))
    inner = apart[:, 1:-1].min(axis=1)
    between = inner + CLEARLY * width < np.minimum(apart[:, 0], apart[:, -1])
    unseen = between & (inner <= gap + NEAREST * width)
    if gap > width or not unseen.any():
        return None
    return float(np.linalg.norm(stop - start, axis=2)[unseen].max()), width


def _distance(points: Array, X: Array, other: Faces, width: float) -> Array:
    """Distance of points from a surface [m], shape (...), of points of shape (..., 3); inf beyond two widths."""
    from scipy.spatial import KDTree

    at = points.reshape(-1, 3)
    corners = X[other.node]
    radius = float(np.linalg.norm(corners - other.middle[:, None], axis=2).max())
    near = KDTree(other.middle).query(at, distance_upper_bound=radius + 2.0 * width)[0] < np.inf
    found = np.full(len(at), np.inf)
    if near.any():
        place = project(at[near], X, other.node)
        weight = np.clip(place.weight, 0.0, None)  # beyond the edges of a face the nearest place is on them
        weight /= weight.sum(axis=1, keepdims=True)
        found[near] = np.linalg.norm(at[near] - np.einsum("pc,pci->pi", weight, corners[place.face]), axis=1)
    return found.reshape(points.shape[:-1])


def _least_width(X: Array, side: Faces) -> float:
    """Least width of a surface across its longest principal axis [m], of a flat one its width in its plane.

    It is the shorter side of the smallest rectangle around the surface, seen along that axis.
    """
    points = X[side.nodes] - X[side.nodes].mean(axis=0)
    _, _, axes = np.linalg.svd(points, full_matrices=False)
    across = points @ axes[1:].T
    angle = np.radians(np.arange(90.0))
    turns = np.stack([np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)], axis=1).reshape(-1, 2, 2)
    extents = np.array([np.ptp(across @ turned.T, axis=0) for turned in turns])
    least, most = np.sort(extents[extents.prod(axis=1).argmin()])
    return float(least if least > FLAT * most else most)
