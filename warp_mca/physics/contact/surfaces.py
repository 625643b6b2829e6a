"""Owns the host side of contact: surfaces, penalty stiffness and what the springs add to the stable step."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.joining import AS_IS, joinable, of
from warp_mca.geometry.cell_types import is_triangle
from warp_mca.physics.contact.friction_laws import friction_values
from warp_mca.physics.contact.sides import find_sides, is_curved, stiffest_fold
from warp_mca.scene import Contact, RigidPlane
from warp_mca.scene.contact_laws import law_values

Array = NDArray[np.float64]
Index = NDArray[np.int32]

SEARCH_MARGIN = 0.25  # margin of the search for faces, as a share of the edge of the smallest face
LIST_LENGTH = 32  # faces near a slave node, and slave nodes near a face at least; a full list stops the run
LONGEST_LIST = 4096  # slave nodes near a face at most
# Default spring stiffness over E* A^2 / V, with E* = E / (1 - nu^2): at nu = 0.3 as penalty = 1 and 5. Few nodes carry
# a curved contact, so softer springs lower its force peak; see docs/measurements/methods.md.
FLAT, CURVED = 0.7583, 3.792


@dataclass(frozen=True)
class Faces:
    """A surface in the model's numbering.

    Attributes:
        node: corners of each face, counter-clockwise from outside, shape (face_count, 4), int32; triangles have
            their last one twice.
        element: that each face bounds, shape (face_count,), int32.
        area: [m^2], shape (face_count,), float64.
        normal: outwards, as long as the area [m^2], shape (face_count, 3), float64.
        middle: mean of the corners [m], shape (face_count, 3), float64.
        bulk: K A^2 / V of each face [N/m], shape (face_count,), float64.
        contact: E* A^2 / V of each face, with E* = E / (1 - nu^2) [N/m], shape (face_count,), float64.
    """

    node: Index
    element: Index
    area: Array
    normal: Array
    middle: Array
    bulk: Array
    contact: Array

    @property
    def nodes(self) -> Index:
        """The surface's nodes, sorted, shape (node_count,), int32."""
        return np.unique(self.node).astype(np.int32)


@joinable
@dataclass(frozen=True, kw_only=True)
class ContactPass:
    """Slave nodes against a plane or against faces.

    Attributes:
        slave: node indices, shape (slave_count,), int32.
        stiffness: greatest penalty stiffness of each, that of its own faces [N/m], shape (slave_count,), float64.
        mu: coefficient of friction [-].
        law, parameters: module of the contact law, and what its functions read.
        friction: modules of the laws of friction.
        friction_parameters: what their functions read, shape (slave_count, law_count, parameter_count), float64.
        stiffening: greatest slope of the law down to the penetration that stops the run, over the stiffness [-].
        damping: greatest slope of its dashpot over the rate, over the stiffness [s]; 0 without a dashpot.
        decay: greatest of what dashpots add to the diagonal of M^-1 C, by the bound of `contact_eigenvalues` [1/s].
        slave_face, slave_offset, face_of_slave: the slave's faces, and those around each slave node, compressed rows,
            int32.
        sign: +1 where the forces on the slaves are the contact's forces, -1 in the return pass of two-way contact.
        contact: which of the scene's contacts this belongs to.
        plane: the rigid plane, or None.
        face: master faces, shape (face_count, 4), int32.
        face_stiffness: greatest penalty stiffness of a node on each face [N/m], shape (face_count,), float64.
        side: of the master that each face belongs to, shape (face_count,), int32; see `warp_mca.physics.contact.sides`.
        at_once: how many times stiffer than one spring those of all sides are on a slave node, at most [-].
        master: their nodes, shape (master_count,), int32.
        face_offset, face_of_node: faces around each master node, compressed rows, int32.
        margin: that the search looks ahead [m].
        longest: edge of the largest face [m].
        room: slave nodes that the list of a face holds.
        deepest: penetration of a plane that stops the run [m]; faces have half their own size.
        initial_overlap: as in `Contact`.
    """

    slave: Index = field(metadata=of("nodes"))
    stiffness: Array = field(metadata=AS_IS)
    mu: float = field(metadata=AS_IS)
    sign: float = field(metadata=AS_IS)
    contact: int = field(metadata=AS_IS)
    law: str = field(metadata=AS_IS)
    parameters: tuple[float, ...] = field(metadata=AS_IS)
    stiffening: float = field(metadata=AS_IS)
    friction: tuple[str, ...] = field(default=(), metadata=AS_IS)
    friction_parameters: Array = field(default_factory=lambda: np.zeros((0, 0, 0)), metadata=AS_IS)
    damping: float = field(default=0.0, metadata=AS_IS)
    decay: float = field(default=0.0, metadata=AS_IS)
    plane: RigidPlane | None = field(default=None, metadata=AS_IS)
    face: Index = field(default_factory=lambda: np.zeros((0, 4), np.int32), metadata=of("nodes"))
    face_stiffness: Array = field(default_factory=lambda: np.zeros(0), metadata=AS_IS)
    side: Index = field(default_factory=lambda: np.zeros(0, np.int32), metadata=AS_IS)
    at_once: float = field(default=1.0, metadata=AS_IS)
    slave_face: Index = field(default_factory=lambda: np.zeros((0, 4), np.int32), metadata=of("nodes"))
    slave_offset: Index = field(default_factory=lambda: np.zeros(1, np.int32), metadata=AS_IS)
    face_of_slave: Index = field(default_factory=lambda: np.zeros(0, np.int32), metadata=AS_IS)
    master: Index = field(default_factory=lambda: np.zeros(0, np.int32), metadata=of("nodes"))
    face_offset: Index = field(default_factory=lambda: np.zeros(1, np.int32), metadata=AS_IS)
    face_of_node: Index = field(default_factory=lambda: np.zeros(0, np.int32), metadata=AS_IS)
    margin: float = field(default=0.0, metadata=AS_IS)
    longest: float = field(default=0.0, metadata=AS_IS)
    room: int = field(default=LIST_LENGTH, metadata=AS_IS)
    deepest: float = field(default=0.0, metadata=AS_IS)
    initial_overlap: str = field(default="refuse", metadata=AS_IS)

    @property
    def smallest_area(self) -> float:
        """Area of the smallest master face [m^2], from the margin of the search."""
        return (self.margin / SEARCH_MARGIN) ** 2

    @property
    def sides(self) -> int:
        """How many sides the master has."""
        return int(self.side.max(initial=0)) + 1


def face_geometry(X: Array, face: Index) -> tuple[Array, Array]:
    """Areas [m^2], shape (face_count,), and area-weighted normals [m^2], shape (face_count, 3), of bilinear faces."""
    a, b, c, d = (X[face[:, k]] for k in range(4))
    normal = 0.5 * np.cross(c - a, d - b)
    return np.linalg.norm(normal, axis=1), normal


def make_faces(X: Array, face: Index, element: Index, K: Array, G: Array, volume: Array) -> Faces:
    """Faces with the penalty stiffness K A^2 / V of Hallquist (LS-DYNA theory manual, contact, Eq. 26.6).

    Args:
        X: positions [m], shape (node_count, 3). face: shape (face_count, 4). element: of each face.
        K, G: bulk and shear modulus [Pa] and volume: [m^3] of every element, shape (element_count,).
    """
    area, normal = face_geometry(X, face)
    K, G, volume = K[element], G[element], volume[element]
    contact = 4.0 * G * (3.0 * K + G) / (3.0 * K + 4.0 * G)  # E / (1 - nu^2)
    middle = X[face].mean(axis=1)
    return Faces(face, element, area, normal, middle, K * area**2 / volume, contact * area**2 / volume)


def spring_stiffness(contact: Contact, slave: Faces, master: Faces | None) -> tuple[float, Array, Array]:
    """Penalty stiffness as a factor [-] times that of each face of the slave and of the master [N/m].

    A number f gives f K A^2 / V. The default takes E* in place of K, so that it suits any Poisson's ratio, and is
    stiffer where one of the surfaces is curved. Two passes of one contact have half of it each.
    """
    surfaces = [slave] if master is None else [slave, master]
    if contact.penalty is None:
        factor = CURVED if any(is_curved(faces.node, faces.normal) for faces in surfaces) else FLAT
        found = [faces.contact for faces in surfaces]
    else:
        assert not isinstance(contact.penalty, str)  # `auto_penalty.settled` has replaced it
        factor, found = contact.penalty, [faces.bulk for faces in surfaces]
    return 0.5 * factor if contact.two_way else factor, found[0], found[-1]


def _node_mean(nodes: Index, faces: Faces, value: Array) -> Array:
    """Mean over the faces around each node of a value given on faces."""
    total = np.zeros(nodes[-1] + 1)
    count = np.zeros(nodes[-1] + 1)
    for corner in range(4):
        np.add.at(total, faces.node[:, corner], value)
        np.add.at(count, faces.node[:, corner], 1.0)
    return total[nodes] / count[nodes]


def _room(slave: Faces, master: Faces, margin: float) -> int:
    """Slave nodes that the list of a face has to hold: as many as lie within `margin` around the largest, and as many
    again where that face lies aslant to its box or an edge of the slave reaches in; a multiple of LIST_LENGTH."""

    def cell(faces: Faces) -> Array:  # area for each node of a grid; the box around a triangle has twice its area
        return np.where(is_triangle(faces.node), 2.0, 1.0) * faces.area

    side = float(np.sqrt(cell(master).max())) + 2.0 * margin
    spacing = float(np.sqrt(_node_mean(slave.nodes, slave, cell(slave)).min()))
    most = 2.0 * (side / spacing + 1.0) ** 2
    return min(LIST_LENGTH * math.ceil(most / LIST_LENGTH), LONGEST_LIST)


def _faces_around(nodes: Index, face: Index) -> tuple[Index, Index]:
    """Faces around each of the `nodes` of a surface, as compressed rows: their offsets, and the faces, int32."""
    corner = face.ravel()
    order = np.argsort(corner, kind="stable")
    again = np.zeros(face.shape, dtype=bool)
    again[:, 3] = is_triangle(face)
    order = order[~again.ravel()[order]]  # a triangle's last corner counts once
    offset = np.searchsorted(corner[order], np.append(nodes, nodes[-1] + 1))
    return offset.astype(np.int32), (order // 4).astype(np.int32)


def _surface_pass(
    contact: Contact, index: int, slave: Faces, master: Faces, factor: float, own: Array, other: Array, sign: float
) -> ContactPass:
    nodes, masters = slave.nodes, master.nodes
    margin = SEARCH_MARGIN * float(np.sqrt(master.area.min()))
    longest = float(np.sqrt(master.area.max()))
    side = find_sides(master.node, master.normal)
    offset, around = _faces_around(masters, master.node)
    slave_offset, around_slave = _faces_around(nodes, slave.node)
    return ContactPass(
        slave=nodes,
        stiffness=factor * _node_mean(nodes, slave, own),
        face_stiffness=factor * other,
        mu=contact.mu,
        **law_values(contact.law, 0.5 * longest),
        **friction_values(contact, slave),
        slave_face=slave.node,
        slave_offset=slave_offset,
        face_of_slave=around_slave,
        sign=sign,
        contact=index,
        face=master.node,
        side=side,
        at_once=stiffest_fold(master.node, master.normal, master.middle) if side.any() else 1.0,
        master=masters,
        face_offset=offset,
        face_of_node=around,
        margin=margin,
        longest=longest,
        room=_room(slave, master, margin),
        initial_overlap=contact.initial_overlap,
    )


def is_curved_contact(X: Array, item: ContactPass) -> bool:
    """Whether one of the surfaces of a pass is curved; a plane is not. X: positions [m], shape (node_count, 3)."""
    return any(is_curved(face, face_geometry(X, face)[1]) for face in (item.slave_face, item.face) if len(face))


def contact_passes(contact: Contact, index: int, slave: Faces, master: Faces | None) -> list[ContactPass]:
    """One pass, or two when the contact is two-way: then each carries half the stiffness.

    The spring of a slave node has the stiffness of the node's own faces or of the master face that it touches,
    whichever is lower; `kernels.contact.contact` says what happens where the node slides on to a softer face.
    """
    factor, own, other = spring_stiffness(contact, slave, master)
    if master is None:
        assert isinstance(contact.master, RigidPlane)
        nodes = slave.nodes
        deepest = 0.5 * float(np.sqrt(slave.area.mean()))
        return [
            ContactPass(
                slave=nodes,
                stiffness=factor * _node_mean(nodes, slave, own),
                slave_face=slave.node,
                mu=contact.mu,
                **law_values(contact.law, deepest),
                **friction_values(contact, slave),
                sign=1.0,
                contact=index,
                plane=contact.master,
                deepest=deepest,
                initial_overlap=contact.initial_overlap,
            )
        ]
    passes = [_surface_pass(contact, index, slave, master, factor, own, other, 1.0)]
    if contact.two_way:
        passes.append(_surface_pass(contact, index, master, slave, factor, other, own, -1.0))
    return passes


def contact_eigenvalues(item: ContactPass, slave: Faces, master: Faces | None, mass: Array) -> tuple[Index, Array]:
    """What a pass can add to the largest eigenvalue at its nodes [1/s^2]: row sums of M^-1 K of its springs.

    A slave's row sums to k (1 + sum N) / m = 2 k / m, or k / m against a plane, and to more where sides of the master
    press it at once; a master node's to as much, times the number of slave nodes that share its area. k is the greatest
    stiffness that the spring can have: that of the stiffest master face for a slave node, that of the stiffest face
    around it for a master node; both times what the contact law adds as it stiffens.
    """
    if master is None:
        return item.slave, item.stiffening * item.stiffness / mass[item.slave]
    at_once = item.stiffening * item.at_once
    slave_k = at_once * np.minimum(item.stiffness, item.face_stiffness.max())
    around = np.maximum.reduceat(item.face_stiffness[item.face_of_node], item.face_offset[:-1])
    master_k = at_once * np.minimum(around, item.stiffness.max())
    slave_area = 4.0 * np.median(_node_mean(item.slave, slave, slave.area / 4.0))
    shared = np.maximum(1.0, 4.0 * _node_mean(item.master, master, master.area / 4.0) / slave_area)
    nodes = np.concatenate([item.slave, item.master])
    return nodes, np.concatenate([2.0 * slave_k / mass[item.slave], 2.0 * master_k * shared / mass[item.master]])
