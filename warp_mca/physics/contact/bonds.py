"""Owns bonds of contacts on the host: which slave nodes are glued to which place on the master's faces."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.joining import offsets
from warp_mca.geometry.face_projection import Projected, project
from warp_mca.kernels.contact import bond
from warp_mca.physics.contact.friction_laws import node_areas
from warp_mca.physics.contact.sides import face_geometry, find_sides
from warp_mca.scene import Contact, Surface
from warp_mca.system.contact import BondedNodes
from warp_mca.system.reading import on_host

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.physics.contact.contact_state import ContactState
    from warp_mca.physics.contact.stage import ContactStage
    from warp_mca.scene import Scene
    from warp_mca.system.contact import ContactPass, Faces
    from warp_mca.system.state import State

OPPOSED = -0.7  # cosine between the normals of a face and of one of the slave's around a node that it holds, at most
LINE = 1e-3  # of the longest edge of their faces: glued nodes that spread less lie in a line
BEYOND = 0.1  # of a face's width, by which glued nodes may lie beyond its edges, as on the chords of a coarse rim
OFF = 1e-6  # of a face's edge, by which glued nodes may be off their place at the start: rounding


class Place(NamedTuple):
    """Where nodes lie on faces.

    Attributes:
        node: of the slave, in its own body's numbering, shape (count,).
        face: of the master's surface, shape (count,).
        weight: shape functions of its corners there [-], shape (count, 4), float64.
        edge: longest edge of that face [m], shape (count,), float64.
    """

    node: Index
    face: Index
    weight: Array
    edge: Array


def places(contact: Contact, meshes: Mapping[str, Mesh], X: Mapping[str, Array]) -> Place:
    """Slave nodes of a contact with a bond that lie on faces of the master which look against theirs.

    Bodies stand at X [m], by body, shape (node_count, 3), float64.

    Raises:
        RequestError: there are none, or they lie in a line.
    """
    assert contact.bond and isinstance(contact.master, Surface)
    own, _ = meshes[contact.slave.body].surface(contact.slave.nodes)
    faces, _ = meshes[contact.master.body].surface(contact.master.nodes)
    x, points, nodes = X[contact.slave.body], X[contact.master.body], np.unique(own)
    side, best = find_sides(faces, normals(points, faces)), np.full(len(nodes), math.inf)
    face, weight, edge = np.zeros(len(nodes), np.int32), np.zeros((len(nodes), 4)), np.zeros(len(nodes))
    for p in range(side.max(initial=0) + 1):
        which, found, opposed = nearest_of_side(
            x, nodes, own, points, faces, np.flatnonzero(side == p).astype(np.int32)
        )
        corner = points[faces[which]]
        longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
        near = (
            (found.distance <= contact.bond.gap * longest) & (found.beyond <= BEYOND) & (found.apart < best) & opposed
        )
        best[near], face[near] = found.apart[near], which[near]
        weight[near], edge[near] = found.weight[near], longest[near]
    glued = np.isfinite(best)
    if not glued.any():
        remedy = "no slave node lies on the master's faces at the start; let the surfaces meet, or raise gap"
        raise bad_value(f"Contact {'–'.join(contact.sides)}: Bond.gap", contact.bond.gap, remedy)
    spread = np.linalg.svd(x[nodes[glued]] - x[nodes[glued]].mean(axis=0), compute_uv=False)
    if len(spread) < 2 or spread[1] <= LINE * edge.max():
        remedy = "they lie in a line, about which the bodies would turn; leave the pair in contact, or let faces meet"
        raise bad_value(f"Contact {'–'.join(contact.sides)}: nodes that its bond holds", int(glued.sum()), remedy)
    return Place(nodes[glued], face[glued], weight[glued], edge[glued])


def normals(X: Array, face: Index) -> Array:
    """Unit normals of faces [-], shape (face_count, 3)."""
    area, normal = face_geometry(X, face)
    return normal / area[:, None]


def nearest_of_side(
    x: Array, nodes: Index, own: Index, X: Array, faces: Index, number: Index
) -> tuple[Index, Projected, NDArray[np.bool_]]:
    """Of the faces of these numbers, the nearest to each slave node; where the node lies on it; whether it looks
    against one of the slave's faces around the node.

    Args:
        x, X: positions of the slave's and the master's nodes [m], shape (node_count, 3), float64.
        nodes: of the slave, shape (slave_count,). own, faces: corners of the faces of both, shape (face_count, 4).
        number: of faces of the master, shape (count,).
    """
    found = project(x[nodes], X, faces[number])
    which, cosine, normal = number[found.face], np.full(len(x), math.inf), np.zeros_like(x)
    normal[nodes] = normals(X, faces[which])
    mine = normals(x, own)
    for k in range(4):
        np.minimum.at(cosine, own[:, k], (mine * normal[own[:, k]]).sum(axis=1))
    return which, found, cosine[nodes] <= OPPOSED


def on_bonds(
    scene: Scene, meshes: Mapping[str, Mesh], X: Mapping[str, Array]
) -> tuple[dict[int, Place], Mapping[str, Array]]:
    """Places of the glued nodes, by the number of their contact, and positions with these nodes on the faces."""
    found: dict[int, Place] = {}
    for index, contact in enumerate(scene.contacts):
        if isinstance(contact, Contact) and contact.bond and isinstance(contact.master, Surface):
            found[index] = own = places(contact, meshes, X)
            faces, _ = meshes[contact.master.body].surface(contact.master.nodes)
            moved = X[contact.slave.body].copy()
            moved[own.node] = _at(X[contact.master.body], faces[own.face], own.weight)
            X = {**X, contact.slave.body: moved}
    return found, X


def _at(X: Array, corner: Index, weight: Array) -> Array:
    """Places on faces [m], shape (count, 3), by their corners and shape functions, both of shape (count, 4)."""
    return np.einsum("sk,ski->si", weight, X[corner])


def bonded(item: ContactPass, contact: Contact, place: Place, first: int, slave: Faces, X: Array) -> ContactPass:
    """A pass with bonds; nodes of the slave's body are numbered from `first` on, and stand at X [m] with all others.

    Raises:
        RequestError: something moved a glued node or its face once more.
    """
    assert contact.bond
    row = np.searchsorted(item.slave, place.node + first)
    count = len(item.slave)
    face, weight = np.full(count, -1, np.int32), np.zeros((count, 4))
    face[row], weight[row] = place.face, place.weight
    off = np.linalg.norm(X[item.slave[row]] - _at(X, item.face[place.face], place.weight), axis=1)
    if (off > OFF * place.edge).any():
        remedy = "another bond or a tie moves its nodes or faces, too; let the meshes of these surfaces meet"
        raise bad_value(f"Contact {'–'.join(contact.sides)}: Bond.gap", contact.bond.gap, remedy)
    strength = [math.inf if value is None else value for value in (contact.bond.normal, contact.bond.shear)]
    limit = node_areas(slave)[:, None] * np.array(strength)
    return replace(item, bonds=BondedNodes(face=face, weight=weight, limit=limit))


def glue(spring: Any, stage: ContactStage) -> None:
    """Give the springs of a stage their bonds; none where no scene has any."""
    count = int(stage.springs[-1]) if stage.laws.bond else 0
    holds, limit = np.zeros(count, np.int32), np.zeros((count, 2))
    if count:
        face, weight = np.full(count, -1, np.int32), np.zeros((count, 4))
        faces = offsets([len(item.face) for item in stage.items])
        for item, first, start in zip(stage.items, stage.springs, faces, strict=False):
            if item.bonds is not None:
                row = np.flatnonzero(item.bonds.face >= 0)
                own = item.bonds.face[row]
                place = first + stage.sides * row + item.side[own]
                holds[place], face[place], weight[place] = 1, own + start, item.bonds.weight[row]
                limit[place] = item.bonds.limit[row]
        spring.face, spring.weight = wp.array(face, dtype=wp.int32), wp.array(weight, dtype=wp.vec4d)
    spring.bond, spring.bond_limit = wp.array(holds, dtype=wp.int32), wp.array(limit, dtype=wp.vec2d)
    spring.bond_time = wp.zeros(count, dtype=wp.float64)


def list_bonds(stage: ContactStage, own: ContactState, state: State) -> None:
    """Put bonds into the lists of a search, whether it found them or not."""
    for kernel in bond_lists(stage):
        inputs = [stage.slave_scene, own.count, own.candidate, own.spring]
        wp.launch(kernel, int(stage.springs[-1]), inputs, [own.face_count, own.face_slave, state.flag])


def bond_lists(stage: ContactStage) -> list[Any]:
    """The kernel of `list_bonds`, where there are bonds."""
    return [bond.list_kernel(stage.each, stage.sides)] if stage.laws.bond else []


def bond_reports(stages: Sequence[ContactStage], state: State, scene: int, X: Array) -> dict[int, dict[str, object]]:
    """What the summary says of the bonds of a scene, by the number of their contact: nodes, how many failed, and when
    and where, as they stood at the start, the first and the last did.

    X: positions of all nodes at the start [m], shape (node_count, 3), float64.
    """
    items = [(stage, stage.items[scene]) for stage in stages]
    return {item.contact: _report(stage, state, scene, X) for stage, item in items if item.bonds is not None}


def _report(stage: ContactStage, state: State, scene: int, X: Array) -> dict[str, object]:
    spring, item = state.contacts[stage.index].spring, stage.items[scene]
    mine = slice(int(stage.springs[scene]), int(stage.springs[scene + 1]))
    holds, time = on_host(spring.bond)[mine], on_host(spring.bond_time)[mine]
    failed = np.flatnonzero(holds < 0)
    found: dict[str, object] = {"nodes": int((holds != 0).sum()), "failed": len(failed)}
    if not len(failed):
        return {**found, "first_failure": None, "last_failure": None}
    row = failed[np.argsort(time[failed], kind="stable")]
    first, last = ({"time": float(time[k]), "at": X[item.slave[k // stage.sides]].tolist()} for k in row[[0, -1]])
    return {**found, "first_failure": first, "last_failure": last}
