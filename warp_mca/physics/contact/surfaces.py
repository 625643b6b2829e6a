"""Owns the host side of contact: surfaces, penalty stiffness and what the springs add to the stable step."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.joining import AS_IS, joinable, of
from warp_mca.geometry.cell_types import is_triangle
from warp_mca.physics.contact.bonds import BondedNodes
from warp_mca.physics.contact.friction_laws import friction_values
from warp_mca.physics.contact.pairs import SLOTS, Pairs
from warp_mca.physics.contact.sides import face_geometry, find_sides, is_curved, stiffest_fold
from warp_mca.physics.contact.stiffness import node_mean, spring_stiffness
from warp_mca.scene import Contact, ContactAll, RigidPlane
from warp_mca.scene.contact_laws import law_values

Array = NDArray[np.float64]
Index = NDArray[np.int32]

SEARCH_MARGIN = 0.25  # margin of the search for faces, as a share of the edge of the smallest face
LIST_LENGTH = 32  # faces near a slave node, and slave nodes near a face at least; a full list stops the run
LONGEST_LIST, ENTRIES = 4096, 2**24  # slave nodes near a face at most; more if all lists have no more entries than so


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
        across: length of the longest diagonal or edge [m], shape (face_count,), float64.
        bulk: K A^2 / V of each face [N/m], shape (face_count,), float64.
        contact: E* A^2 / V of each face, with E* = E / (1 - nu^2) [N/m], shape (face_count,), float64.
        layer: E* A / d of each face, with the height d of its cell over it [N/m], shape (face_count,), float64.
    """

    node: Index
    element: Index
    area: Array
    normal: Array
    middle: Array
    across: Array
    bulk: Array
    contact: Array
    layer: Array

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
        sign: +1 where the forces on the slaves are the contact's forces, -1 in the return pass of two-way contact,
            0 of a general contact, whose springs hold both.
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
        pairs: bodies of a general contact, or None.
        bonds: that glue its slave nodes, or None.
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
    pairs: Pairs | None = field(default=None, metadata=AS_IS)
    bonds: BondedNodes | None = field(default=None, metadata=AS_IS)

    @property
    def leads(self) -> bool:
        """Whether it is the pass of the slave's nodes, which every contact has."""
        return self.sign > 0.0

    @property
    def smallest_area(self) -> float:
        """Area of the smallest master face [m^2], from the margin of the search."""
        return (self.margin / SEARCH_MARGIN) ** 2

    @property
    def sides(self) -> int:
        """How many springs a slave node has: for each side of the master, of several bodies in a general contact."""
        sides = int(self.side.max(initial=0)) + 1
        return sides * SLOTS if self.pairs and sides > 1 else sides


def make_faces(
    X: Array, face: Index, element: Index, K: Array, G: Array, volume: Array, height: Array | None = None
) -> Faces:
    """Faces with the penalty stiffness K A^2 / V of Hallquist (LS-DYNA theory manual, contact, Eq. 26.6).

    Args:
        X: positions [m], shape (node_count, 3). face: shape (face_count, 4). element: of each face.
        K, G: bulk and shear modulus [Pa] and volume: [m^3] of every element, shape (element_count,).
        height: of every element over its faces, over volume by area [-], shape (element_count,); None: 1 for all.
    """
    area, normal = face_geometry(X, face)
    K, G, volume = K[element], G[element], volume[element]
    contact = 4.0 * G * (3.0 * K + G) / (3.0 * K + 4.0 * G)  # E / (1 - nu^2)
    corner = X[face]
    middle, across = corner.mean(axis=1), np.linalg.norm(corner[:, :, None] - corner[:, None], axis=3).max(axis=(1, 2))
    bulk, own = K * area**2 / volume, contact * area**2 / volume
    return Faces(
        face, element, area, normal, middle, across, bulk, own, own if height is None else own / height[element]
    )


def _room(slave: Faces, master: Faces, margin: float) -> int:
    """Slave nodes that the list of a face holds; a multiple of LIST_LENGTH.

    Its box is about as wide as the face is across if it lies aslant, and three sides of the slave meet in a corner.
    """
    cell = np.where(is_triangle(slave.node), 2.0, 1.0) * slave.area  # area for each node of a grid
    spacing = float(np.sqrt(node_mean(slave.nodes, slave, cell).min()))
    most = min(3.0 * ((master.across.max() + 2.0 * margin) / spacing + 1.0) ** 2, len(slave.nodes))
    return min(LIST_LENGTH * math.ceil(most / LIST_LENGTH), max(LONGEST_LIST, ENTRIES // len(master.node)))


def _faces_around(nodes: Index, face: Index) -> tuple[Index, Index]:
    """Faces around each of the `nodes` of a surface, as compressed rows: their offsets, and the faces, int32."""
    corner = face.ravel()
    order = np.argsort(corner, kind="stable")
    again = np.zeros(face.shape, dtype=bool)
    again[:, 3] = is_triangle(face)
    order = order[~again.ravel()[order]]  # a triangle's last corner counts once
    offset = np.searchsorted(corner[order], np.append(nodes, nodes[-1] + 1))
    return offset.astype(np.int32), (order // 4).astype(np.int32)


def surface_pass(
    contact: Contact | ContactAll, index: int, slave: Faces, master: Faces, own: Array, other: Array, sign: float
) -> ContactPass:
    """A pass in which nodes of the slave have the stiffness `own`, and faces of the master `other` [N/m]."""
    nodes, masters = slave.nodes, master.nodes
    margin = SEARCH_MARGIN * float(np.sqrt(master.area.min()))
    longest = float(np.sqrt(master.area.max()))
    side = find_sides(master.node, master.normal)
    offset, around = _faces_around(masters, master.node)
    slave_offset, around_slave = _faces_around(nodes, slave.node)
    return ContactPass(
        slave=nodes,
        stiffness=own,
        face_stiffness=other,
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


def contact_passes(
    contact: Contact, index: int, slave: Faces, master: Faces | None, flat: bool | None = None
) -> list[ContactPass]:
    """One pass, or two when the contact is two-way: then each carries half the stiffness.

    The spring of a slave node has the stiffness of the node's own faces or of the master face that it touches,
    whichever is lower; `kernels.contact.contact` says what happens where the node slides on to a softer face. `flat`:
    as in `spring_stiffness`.
    """
    own, *other = spring_stiffness(contact, slave, master, flat)
    if master is None:
        assert isinstance(contact.master, RigidPlane)
        nodes = slave.nodes
        deepest = 0.5 * float(np.sqrt(slave.area.mean()))
        return [
            ContactPass(
                slave=nodes,
                stiffness=own[0],
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
    passes = [surface_pass(contact, index, slave, master, own[0], other[0][1], 1.0)]
    if contact.two_way:
        passes.append(surface_pass(contact, index, master, slave, other[0][0], own[1], -1.0))
    return passes
