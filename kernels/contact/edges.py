"""Owns the geometry of a master's edges: which faces meet at the edge of a solid, and which of them a node faces."""

import warp as wp

from warp_mca.kernels.contact.nearest import Master
from warp_mca.kernels.contact.pairs import Pairs, pair_factor
from warp_mca.kernels.contact.projection import area_vector

_ACROSS = 0.1  # least cosine between the reversed normal of a face that lies across an edge and those of its two sides


@wp.struct
class SlaveFaces:
    """Slave nodes, and the faces of the slave surface around each, as compressed rows.

    Attributes:
        node: shape (slave_count,), int32.
        stiffness: penalty stiffness of each [N/m], shape (slave_count,), float64.
        face: nodes, shape (face_count, 4), int32; a triangle has its last node twice.
        offset: first entry of each slave node in face_of_slave, shape (slave_count + 1,), int32.
        face_of_slave: faces around the slave nodes, one after the other, int32.
        number: of each node of the model among the slave nodes, shape (node_count,), int32.
    """

    node: wp.array(dtype=wp.int32)
    stiffness: wp.array(dtype=wp.float64)
    face: wp.array2d(dtype=wp.int32)
    offset: wp.array(dtype=wp.int32)
    face_of_slave: wp.array(dtype=wp.int32)
    number: wp.array(dtype=wp.int32)


@wp.struct
class Surfaces:
    """A slave and a master that has several sides.

    Attributes:
        X: reference positions [m], shape (node_count,), vec3d.
        u: displacements [m], shape (node_count,), vec3d.
        master: faces of the master.
        slaves: nodes and faces of the slave.
        pairs: bodies of a general contact.
    """

    X: wp.array(dtype=wp.vec3d)
    u: wp.array(dtype=wp.vec3d)
    master: Master
    slaves: SlaveFaces
    pairs: Pairs


@wp.func
def greatest_stiffness(at: Surfaces, s: int, f: int) -> wp.float64:
    """Penalty stiffness of slave node s on face f: the lower one of both [N/m]."""
    return pair_factor(at.pairs, s, f) * wp.min(at.slaves.stiffness[s], at.master.stiffness[f])


@wp.func
def neighbour(face: wp.array2d(dtype=wp.int32), f: int, i: int, step: int) -> int:
    """Node of face f that follows node i, or comes before it where step is 3."""
    found = i
    for c in range(4):
        if face[f, c] == i:
            other = face[f, (c + step) % 4]
            if other == i:  # the last corner of a triangle, which it has twice
                other = face[f, (c + 2 * step) % 4]
            found = other
    return found


@wp.func
def is_on_rim(slave_faces: SlaveFaces, s: int) -> bool:
    """Whether slave node s lies on the rim of an open surface: an edge from it belongs to one face alone."""
    i = slave_faces.node[s]
    begin = slave_faces.offset[s]
    end = slave_faces.offset[s + 1]
    found = bool(False)
    for j in range(begin, end):
        after = neighbour(slave_faces.face, slave_faces.face_of_slave[j], i, 1)
        shared = bool(False)
        for k in range(begin, end):
            if neighbour(slave_faces.face, slave_faces.face_of_slave[k], i, 3) == after:
                shared = bool(True)
        found = found or not shared
    return found


@wp.func
def opposition(at: Surfaces, s: int, normal: wp.vec3d) -> wp.float64:
    """Largest cosine between a reversed normal of the faces around slave node s and a normal of any length."""
    most = wp.float64(-1.0)
    for j in range(at.slaves.offset[s], at.slaves.offset[s + 1]):
        own = area_vector(at.X, at.u, at.slaves.face, at.slaves.face_of_slave[j])
        most = wp.max(most, -wp.dot(wp.normalize(own), wp.normalize(normal)))
    return most


@wp.func
def opposes_both(at: Surfaces, s: int, one: wp.vec3d, other: wp.vec3d) -> bool:
    """Whether one of the faces around slave node s opposes both of these unit normals: it lies across their edge."""
    found = bool(False)
    for j in range(at.slaves.offset[s], at.slaves.offset[s + 1]):
        own = wp.normalize(area_vector(at.X, at.u, at.slaves.face, at.slaves.face_of_slave[j]))
        if wp.max(wp.dot(own, one), wp.dot(own, other)) < wp.float64(-_ACROSS):
            found = bool(True)
    return found
