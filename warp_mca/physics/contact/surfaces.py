"""Owns the host side of contact: surfaces, penalty stiffness and what the springs add to the stable step."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cell_types import is_triangle
from warp_mca.physics.contact.friction_laws import friction_values
from warp_mca.physics.contact.sides import face_geometry, find_sides, is_curved, stiffest_edge
from warp_mca.physics.contact.stiffness import flat_modulus, is_flat, node_mean, spring_stiffness
from warp_mca.scene import Contact, ContactAll, RigidPlane, Surface
from warp_mca.scene.contact_laws import law_values
from warp_mca.system.bodies import Bodies
from warp_mca.system.contact import LIST_LENGTH, SEARCH_MARGIN, ContactPass, Faces

Array = NDArray[np.float64]
Index = NDArray[np.int32]

LONGEST_LIST, ENTRIES = 4096, 2**24  # slave nodes near a face at most; more if all lists have no more entries than so


def make_faces(
    X: Array,
    face: Index,
    element: Index,
    K: Array,
    G: Array,
    volume: Array,
    height: Array | None = None,
    shape: Array | None = None,
) -> Faces:
    """Faces with the penalty stiffness K A^2 / V of Hallquist (LS-DYNA theory manual, contact, Eq. 26.6).

    Args:
        X: positions [m], shape (node_count, 3). face: shape (face_count, 4). element: of each face.
        K, G: bulk and shear modulus [Pa] and volume: [m^3] of every element, shape (element_count,).
        height: of every element over its faces, over volume by area [-], shape (element_count,); None: 1 for all.
        shape: positions that tell whether the surface is curved [m], as `Bodies.shape`; None: X.
    """
    area, normal = face_geometry(X, face)
    K, G, volume = K[element], G[element], volume[element]
    contact = 4.0 * G * (3.0 * K + G) / (3.0 * K + 4.0 * G)  # E / (1 - nu^2)
    corner = X[face]
    middle, across = corner.mean(axis=1), np.linalg.norm(corner[:, :, None] - corner[:, None], axis=3).max(axis=(1, 2))
    bulk, own, flat = (modulus * area**2 / volume for modulus in (K, contact, flat_modulus(contact, K, G)))
    layer = flat if height is None else flat / height[element]
    curved = is_curved(face, normal if shape is None else face_geometry(shape, face)[1])
    return Faces(face, element, area, normal, middle, across, bulk, own, layer, np.full(len(face), curved))


def faces_of(parts: Bodies, body: str, node: Index, element: Index) -> Faces:
    """Faces of a body, whose nodes and elements are those of its mesh."""
    node = (node + parts.node_start[body]).astype(np.int32)
    element = (element + parts.element_start[body]).astype(np.int32)
    volume = parts.volume * parts.face_depth
    return make_faces(parts.X, node, element, parts.K, parts.G, volume, parts.face_height, parts.shape)


def surface_faces(parts: Bodies, surface: Surface) -> Faces:
    """Boundary faces of a surface."""
    return faces_of(parts, surface.body, *parts.meshes[surface.body].surface(surface.nodes))


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


def _returns(contact: Contact | ContactAll) -> bool:
    """Whether springs return the energy of closing and opening: those without a penalty."""
    plain = contact.law is None or not contact.law.damping(0.0)
    held = isinstance(contact, Contact) and contact.bond is not None
    return contact.penalty is None and plain and not held and contact.initial_overlap != "press"


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
        at_once=stiffest_edge(master.node, master.normal),
        master=masters,
        face_offset=offset,
        face_of_node=around,
        margin=margin,
        longest=longest,
        curved=not is_flat(slave, master),
        room=_room(slave, master, margin),
        initial_overlap=contact.initial_overlap,
        internal=contact.internal,
        returns=_returns(contact),
    )


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
                curved=not is_flat(slave, None),
                initial_overlap=contact.initial_overlap,
                internal=contact.internal,
                returns=_returns(contact),
            )
        ]
    passes = [surface_pass(contact, index, slave, master, own[0], other[0][1], 1.0)]
    if contact.two_way:
        passes.append(surface_pass(contact, index, master, slave, other[0][0], own[1], -1.0))
    return passes
