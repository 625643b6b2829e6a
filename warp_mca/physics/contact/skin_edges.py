"""Owns what two surfaces need beside the slave's nodes: edges that may cross between nodes, and the master's nodes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.joining import AS_IS, joinable, of
from warp_mca.kernels.contact.edge_pairs import SLOTS
from warp_mca.physics.contact.sides import SHARP, neighbours
from warp_mca.physics.contact.stiffness import Inertia, edge_stiffness, nearest_faces
from warp_mca.scene import Contact, ContactAll
from warp_mca.system.contact import ContactPass, Faces

BLUNT = math.radians(3.0)  # angle between the faces beside an edge from which on it may press another
TENTH = 0.1  # of the area of a surface that has faces as small as those by which it is judged
WIDER = 1.5  # ratio of widths of the slave's and the master's faces from which on the master's nodes could pass unseen
COARSE = 0.5  # length of an edge that nodes see pass, as a share of the radius of what passes, at most


@dataclass(frozen=True)
class SkinEdges:
    """Convex edges of a surface.

    Attributes:
        node: both ends, shape (edge_count, 2), int32.
        face: the two faces that meet there, shape (edge_count, 2), int32.
        length: [m], shape (edge_count,), float64.
        size: edge of a square as large as those faces [m], shape (edge_count,), float64.
        radius: of a round surface with such an edge, 0 where it is sharp [m], shape (edge_count,), float64.
    """

    node: Index
    face: Index
    length: Array
    size: Array
    radius: Array

    def some(self, kept: np.ndarray) -> SkinEdges:
        """Those of the edges for which `kept` is true."""
        return SkinEdges(*(getattr(self, item.name)[kept] for item in fields(self)))


def skin_edges(X: Array, faces: Faces) -> SkinEdges:
    """Edges of a surface where its faces meet at more than BLUNT, and bulge. X: positions [m], (node_count, 3)."""
    first, second, node = neighbours(faces.node)
    unit = faces.normal / np.linalg.norm(faces.normal, axis=1, keepdims=True)
    cosine = np.clip((unit[first] * unit[second]).sum(axis=1), -1.0, 1.0)
    angle = np.arccos(cosine)
    below = ((faces.middle[second] - faces.middle[first]) * faces.normal[first]).sum(axis=1) < 0.0
    own = below & (angle > BLUNT)
    face = np.column_stack([first, second])[own].astype(np.int32)
    node, angle, cosine = node[own].astype(np.int32), angle[own], cosine[own]
    length = np.linalg.norm(X[node[:, 0]] - X[node[:, 1]], axis=1)
    area = faces.area[face].mean(axis=1)
    radius = np.where(cosine < SHARP, 0.0, area / np.where(length > 0.0, length, 1.0) / angle)
    return SkinEdges(node, face, length, np.sqrt(area), radius)


def is_two_way(contact: Contact, slave: Faces, master: Faces | None, both: bool = False) -> bool:
    """Whether the master's nodes are kept out of the slave's faces, too: as the contact says, or if these are wider.

    They are so on most of the surfaces, and where these are nearest to each other: faces far from contact may be of any
    size. It is so also where nodes of `both` are needed for another reason.
    """
    if contact.two_way is not None or contact.bond or master is None:
        return bool(contact.two_way)
    if both:
        return True
    mine, its = nearest_faces(contact, slave, master)
    local = math.sqrt(slave.area[mine] / master.area[its])
    return min(local, _width(slave.area) / _width(master.area)) > WIDER


def _width(area: Array) -> float:
    """Width of the faces that a TENTH of a surface is smaller than [m]: those of the ends of a rod may be tiny."""
    area = np.sort(area)
    covered = np.cumsum(area)
    return math.sqrt(area[np.searchsorted(covered, TENTH * covered[-1])])


@joinable
@dataclass(frozen=True, kw_only=True)
class EdgePass(ContactPass):
    """Edges of a slave against edges of a master; `slave` is the first end of each of its edges.

    Attributes:
        slave_edge, master_edge: both ends of each edge, shape (edge_count, 2), int32.
        slave_beside, master_beside: corners of the two faces beside each, shape (edge_count, 8), int32.
        slave_size, master_size: edge of a square as large as these faces [m], shape (edge_count,), float64.
        master_stiffness: penalty stiffness of the master's edges [N/m], shape (edge_count,), float64.
        slave_body, master_body: body of each edge in a general contact, shape (edge_count,), int32; else empty.
        factor: of the stiffness between two bodies there, as in `Pairs`, float64; else empty.
    """

    slave_edge: Index = field(metadata=of("nodes"))
    master_edge: Index = field(metadata=of("nodes"))
    slave_beside: Index = field(metadata=of("nodes"))
    master_beside: Index = field(metadata=of("nodes"))
    slave_size: Array = field(metadata=AS_IS)
    master_size: Array = field(metadata=AS_IS)
    master_stiffness: Array = field(metadata=AS_IS)
    slave_body: Index = field(default_factory=lambda: np.zeros(0, np.int32), metadata=AS_IS)
    master_body: Index = field(default_factory=lambda: np.zeros(0, np.int32), metadata=AS_IS)
    factor: Array = field(default_factory=lambda: np.zeros((0, 0)), metadata=AS_IS)

    @property
    def leads(self) -> bool:
        """It comes beside the nodes."""
        return False

    @property
    def sides(self) -> int:
        """Springs of each edge of the slave."""
        return SLOTS


def _kept(edges: SkinEdges, other: SkinEdges) -> np.ndarray:
    """Edges so long that the other surface may pass between their ends."""
    return edges.length > COARSE * other.radius.min(initial=math.inf)


def _shared(first: ContactPass) -> dict[str, Any]:
    """What a pass of edges has from that of the nodes."""
    names = (
        "mu contact law parameters stiffening friction damping face side slave_face margin longest curved "
        "initial_overlap internal returns sign"
    )
    return {name: getattr(first, name) for name in (*names.split(), "face_stiffness")}


def no_edges(first: ContactPass) -> EdgePass:
    """A pass of a contact none of whose edges can press, beside that of its nodes."""
    edge, beside = np.zeros((0, 2), np.int32), np.zeros((0, 8), np.int32)
    none = np.zeros(0)
    return EdgePass(
        **_shared(first),
        slave=edge[:, 0],
        master=first.master,
        stiffness=none,
        friction_parameters=first.friction_parameters[:0],
        slave_edge=edge,
        master_edge=edge,
        slave_beside=beside,
        master_beside=beside,
        slave_size=none,
        master_size=none,
        master_stiffness=none,
    )


def edge_pass(
    X: Array, inertia: Inertia, first: ContactPass, slave: Faces, master: Faces, contact: Contact
) -> EdgePass | None:
    """The pass of the edges of two surfaces beside that of their nodes, or None where nodes see all that can touch.

    Args:
        X: positions [m], shape (node_count, 3).
        inertia: masses of the model.
        first: pass of the slave's nodes.
        slave, master: the surfaces.
        contact: whose pass it is.
    """
    mine, theirs = skin_edges(X, slave), skin_edges(X, master)
    kept, met = _kept(mine, theirs), _kept(theirs, mine)
    if not (kept.any() and met.any()):
        return None
    return _pass(first, slave, master, mine.some(kept), theirs.some(met), contact, inertia)


def general_edges(X: Array, inertia: Inertia, first: ContactPass, union: Faces, contact: ContactAll) -> EdgePass | None:
    """The pass of the edges of all bodies beside that of their nodes in a general contact.

    Args:
        X: positions [m], shape (node_count, 3).
        inertia: masses of the model.
        first: pass of the nodes, which knows the pairs.
        union: skins of all bodies.
        contact: it itself.
    """
    edges = skin_edges(X, union)
    edges = edges.some(_kept(edges, edges))
    if not len(edges.node):
        return None
    assert first.pairs is not None
    found = _pass(first, union, union, edges, edges, contact, inertia)
    body = first.pairs.face[edges.face[:, 0]]
    return replace(found, slave_body=body, master_body=body, factor=np.sign(first.pairs.factor))


def _pass(
    first: ContactPass,
    slave: Faces,
    master: Faces,
    mine: SkinEdges,
    theirs: SkinEdges,
    contact: Contact | ContactAll,
    inertia: Inertia,
) -> EdgePass:
    place = np.searchsorted(first.slave, mine.node[:, 0])
    friction = first.friction_parameters[place] if len(first.friction_parameters) else first.friction_parameters
    return EdgePass(
        **_shared(first),
        slave=mine.node[:, 0],
        master=np.unique(theirs.node).astype(np.int32),
        stiffness=edge_stiffness(contact, slave, mine.face, mine.node, inertia),
        friction_parameters=friction,
        slave_edge=mine.node,
        master_edge=theirs.node,
        slave_beside=slave.node[mine.face].reshape(-1, 8),
        master_beside=master.node[theirs.face].reshape(-1, 8),
        slave_size=mine.size,
        master_size=theirs.size,
        master_stiffness=edge_stiffness(contact, master, theirs.face, theirs.node, inertia),
    )


def edge_eigenvalues(item: EdgePass, mass: Array) -> tuple[Index, Array]:
    """What a pass can add to the largest eigenvalue at its nodes [1/s^2]: that of one crossing at a node, 2 k / m."""
    most = np.zeros(len(mass))
    for edge, own, other in (
        (item.slave_edge, item.stiffness, item.master_stiffness),
        (item.master_edge, item.master_stiffness, item.stiffness),
    ):
        np.maximum.at(most, edge.ravel(), np.repeat(np.minimum(own, other.max()), 2))
    nodes = np.flatnonzero(most).astype(np.int32)
    most *= item.factor.max(initial=0.0) if item.factor.size else 1.0
    return nodes, 2.0 * item.stiffening * most[nodes] / mass[nodes]
