"""Owns the arrays of contact: faces, passes, bodies of a general contact, bonds, and penalties that were chosen."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.joining import AS_IS, joinable, of
from warp_mca.scene import RigidPlane

LIST_LENGTH = 32  # faces near a slave node, and slave nodes near a face at least; a full list stops the run
SEARCH_MARGIN = 0.25  # margin of the search for faces, as a share of the edge of the smallest face
SLOTS = 2  # bodies for which a node at a sharp edge has springs of their own


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """Bodies of a general contact, numbered within their scene.

    Attributes:
        body: of each slave node, shape (slave_count,), int32.
        face: body of each face, shape (face_count,), int32.
        factor: of the stiffness of springs between two bodies [-], 0 where they do not meet, shape (body_count,
            body_count), float64.
        barred_offset, barred: faces of its own body that each slave node never meets, compressed rows, int32.
    """

    body: Index
    face: Index
    factor: Array
    barred_offset: Index
    barred: Index


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
        layer: M A / d of each face, with M of `flat_modulus` and the height d of its cell over it [N/m], shape
            (face_count,), float64.
        curved: whether the surface that it belongs to is, before nodes move onto faces that carry them, shape
            (face_count,), bool.
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
    curved: NDArray[np.bool_]

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
        curved: whether one of its surfaces is; a plane is not.
        room: slave nodes that the list of a face holds.
        deepest: penetration of a plane that stops the run [m]; faces have half their own size.
        initial_overlap, internal: as in `Contact`.
        returns: whether its springs return the energy of closing and opening, see `kernels.contact.switching`.
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
    curved: bool = field(default=False, metadata=AS_IS)
    room: int = field(default=LIST_LENGTH, metadata=AS_IS)
    deepest: float = field(default=0.0, metadata=AS_IS)
    initial_overlap: str = field(default="refuse", metadata=AS_IS)
    internal: bool = field(default=False, metadata=AS_IS)
    returns: bool = field(default=False, metadata=AS_IS)
    pairs: Pairs | None = field(default=None, metadata=AS_IS)
    bonds: BondedNodes | None = field(default=None, metadata=AS_IS)

    @property
    def decay_share(self) -> float:
        """What its dashpots add to the diagonal of M^-1 C, over what its springs add to the eigenvalue there [s]."""
        return self.damping / self.stiffening

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


@dataclass(frozen=True, kw_only=True)
class BondedNodes:
    """Bonds of a contact pass, of each of its slave nodes.

    Attributes:
        face: of the pass, to which the node is glued, or -1, shape (slave_count,), int32.
        weight: shape functions of its corners there [-], shape (slave_count, 4), float64.
        limit: force in tension and in shear at which the bond fails, infinite where it never does [N], shape
            (slave_count, 2), float64.
    """

    face: Index
    weight: Array
    limit: Array


@dataclass(frozen=True, kw_only=True)
class ChosenPenalty:
    """What was chosen for a contact, and why.

    Attributes:
        penalty: factor of the contact stiffness [-].
        why: "curved", or why the default was taken: "flat", or "no approach".
        share: of the energy that springs will hold, by estimate [-]; None where it was not estimated.
        radius: relative radius of curvature where the bodies are nearest to each other [m].
        patch: radius of the contact by Hertz at its greatest force [m].
        mass: that is stopped there, both bodies together [kg].
        speed: of their approach [m/s].
    """

    penalty: float
    why: str
    share: float | None = None
    radius: float | None = None
    patch: float | None = None
    mass: float | None = None
    speed: float | None = None
