"""Owns where nodes of the slave alone do not keep it out of the master: soft ends that bulge, corners that poke."""

from __future__ import annotations

import math

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.physics.contact.sides import find_sides
from warp_mca.physics.contact.stiffness import is_flat, nearest_faces
from warp_mca.scene import Contact
from warp_mca.system.contact import Faces

SOFTER = 0.5  # of the master's modulus that a slave has at most, which spreads more than the master under a pressure
POKES = math.cos(math.radians(20.0))  # between the reversed normal of a face and those around a node that pokes it
AHEAD = 0.02  # of the way to a neighbour, by which it may lie ahead of that node
NEAR = 0.25  # of the width of the slave's faces, as close to the border of the master


def bulges_over(contact: Contact, X: Array, modulus: Array, slave: Faces, master: Faces) -> bool:
    """Whether nodes at the border of a soft flat slave lie on that of a stiffer flat master.

    Pressed, the slave spreads, and these nodes slide off. Nothing bears half a row of its cells then, 44 % of a face
    of 4 x 4 cells, unless nodes of the master keep out of the slave's faces.

    Args:
        contact: of the two surfaces.
        X: positions [m], shape (node_count, 3), float64.
        modulus: E / (1 - nu^2) of each element [Pa], inf of rigid ones, shape (element_count,), float64.
        slave, master: the surfaces.
    """
    if not is_flat(slave, master):
        return False
    own, other = nearest_faces(contact, slave, master)
    if not modulus[slave.element[own]] <= SOFTER * modulus[master.element[other]]:
        return False
    normal = master.normal[other] / np.linalg.norm(master.normal[other])
    ends, corners = _border(slave, own), _border(master, other)
    reach = NEAR * float(np.sqrt(slave.area[own]))
    flat = X - (X @ normal)[:, None] * normal
    return bool(len(ends) and len(corners) and _closest(flat[np.unique(ends)], flat[corners]) < reach)


def _border(faces: Faces, nearest: int) -> Index:
    """Edges at which the side of a surface with the face `nearest` ends, both nodes of each, shape (edge_count, 2)."""
    side = find_sides(faces.node, faces.normal)
    face = faces.node[(side == side[nearest]) & (faces.normal @ faces.normal[nearest] > 0.0)]
    edge = np.sort(np.column_stack([face.ravel(), np.roll(face, -1, axis=1).ravel()]), axis=1)
    edge, count = np.unique(edge[edge[:, 0] != edge[:, 1]], axis=0, return_counts=True)
    return edge[count == 1]


def _closest(points: Array, edges: Array) -> float:
    """Least distance [m] of points, shape (point_count, 3), from straight edges, shape (edge_count, 2, 3)."""
    from scipy.spatial import KDTree

    middle, along = edges.mean(axis=1), edges[:, 1] - edges[:, 0]
    length = np.linalg.norm(along, axis=1)
    near = KDTree(points).query_ball_point(middle, 1.5 * length)  # beyond that, none is nearer than half an edge
    edge = np.repeat(np.arange(len(edges)), [len(found) for found in near])
    arm = points[np.concatenate(near).astype(int)] - edges[edge, 0]
    share = np.clip((arm * along[edge]).sum(axis=1) / length[edge] ** 2, 0.0, 1.0)
    return float(np.linalg.norm(arm - share[:, None] * along[edge], axis=1).min(initial=np.inf))


def pokes(X: Array, slave: Faces, master: Faces) -> bool:
    """Whether a corner or an edge of the master points at the nearest face of the slave, which has no node there.

    Args:
        X: positions [m], shape (node_count, 3), float64.
        slave, master: the surfaces.
    """
    from scipy.spatial import KDTree

    nodes = master.nodes
    _, nearest = KDTree(slave.middle).query(X[nodes])
    normal = slave.normal[nearest] / slave.area[nearest, None]
    arm = X[nodes] - slave.middle[nearest]
    gap = (arm * normal).sum(axis=1)
    within = np.linalg.norm(arm - gap[:, None] * normal, axis=1) < slave.across[nearest]
    if not within.any():
        return False
    first = int(np.where(within, gap, np.inf).argmin())
    around = (master.node == nodes[first]).any(axis=1)
    ways = X[np.unique(master.node[around])] - X[nodes[first]]
    ahead = -(ways @ normal[first]) > AHEAD * np.linalg.norm(ways, axis=1)
    facing = -(master.normal[around] @ normal[first]) / master.area[around]
    return not ahead.any() and float(facing.max()) < POKES
