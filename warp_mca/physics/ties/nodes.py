"""Owns nodes tied to faces: where slaves lie on their masters' faces, and what of their mass the corners carry.

With u_s = sum_k N_sk u_k the equations of motion of the masters are (M u'')_k = f_k + sum_s N_sk f_s. Their mass is
lumped, M_k = m_k + sum_s N_sk m_s: as sum_k N_sk = 1, x_s = sum_k N_sk x_k and v_s = sum_k N_sk v_k, the total mass,
its centre, momentum and angular momentum are those of the nodes (Belytschko et al., Nonlinear Finite Elements, 2014, on
explicit ties). Slaves that lie a gap off their faces are moved there at the start, before masses are computed, and take
the velocity of that place. Bodies that turn as one keep their rigid motion to the last digit; their mass, momentum and
energy are those of the cells as they then are, which differ by the share of the gap in the slave's body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.base.joining import join
from warp_mca.base.rotation import mean_spin
from warp_mca.geometry.face_projection import project
from warp_mca.system.ties import TiedNodes

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.scene import Scene, Tie


MOST_BEYOND = 0.25  # of a face's width: a fine mesh's nodes on a curved rim lie so far beyond the coarse one's chords
MOVING = 1e-6  # of a body's greatest speed: difference of velocities that is rounding
TURNING = 1.01  # times what the rate of turn explains: links whose shape an impact left do not turn quite as rigid ones


def join_ties(items: Sequence[TiedNodes]) -> TiedNodes:
    """The ties of one scene."""
    none = TiedNodes(slave=np.zeros(0, np.int32), master=np.zeros((0, 4), np.int32), weight=np.zeros((0, 4)))
    return join([none, *items], {"nodes": np.zeros(1 + len(items), np.int32)})


def tied_nodes(scene: Scene, meshes: Mapping[str, Mesh], X: Mapping[str, Array]) -> TiedNodes:
    """The ties of a scene whose bodies stand at X [m], by body, shape (node_count, 3), float64.

    Raises:
        RequestError: a slave lies off the master's faces, or nodes are tied twice or to each other.
    """
    first, start = {}, 0
    for body in scene.bodies:
        first[body.name] = start
        start += len(meshes[body.name].points)
    items = [_tied(tie, meshes, X, first) for tie in scene.ties]
    for k, item in enumerate(items):
        for other, own in zip(scene.ties[:k], items[:k], strict=True):
            if np.isin(item.slave, own.slave).any():
                what = f"some of these nodes are tied twice, by {other.title} too; give each tie slave nodes of its own"
                raise bad_value(f"{scene.ties[k].title}.slave", scene.ties[k].slave.nodes, what)
        for other, own in zip(scene.ties, items, strict=True):
            if np.isin(item.slave, own.carriers).any():
                what = f"slaves of {other.title} are tied to some of these nodes; tie both to the same master"
                raise bad_value(f"{scene.ties[k].title}.slave", scene.ties[k].slave.nodes, what)
    return join_ties(items)


def _tied(tie: Tie, meshes: Mapping[str, Mesh], X: Mapping[str, Array], first: Mapping[str, int]) -> TiedNodes:
    slave, master = tie.slave, tie.master
    own, _ = meshes[slave.body].surface(slave.nodes)
    faces, _ = meshes[master.body].surface(master.nodes)
    nodes = np.unique(own)
    if slave.body == master.body and np.isin(nodes, faces).any():
        remedy = f"it shares nodes with {slave.nodes}; tie surfaces that have no node in common"
        raise bad_value(f"{tie.title}.master", master.nodes, remedy)
    at, points = X[slave.body][nodes], X[master.body]
    found = project(at, points, faces)
    corner = points[faces[found.face]]
    edge = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    bad = (found.distance > tie.gap * edge) | (found.beyond > MOST_BEYOND)
    if bad.any():
        k = int(np.argmax(np.where(bad, found.apart, -1.0)))
        x, y, z = meshes[slave.body].points[nodes[k]]
        remedy = (
            f"node {nodes[k]} of {slave.body}, at ({x:.4g}, {y:.4g}, {z:.4g}) m in the body's frame, lies "
            f"{found.apart[k]:.3g} m off the faces of {master.nodes} of {master.body}, whose edges are {edge[k]:.3g} m "
            "long; let the surfaces meet, or raise gap"
        )
        raise bad_value(f"{tie.title}.slave", slave.nodes, remedy)
    widths = (_edge(X[body], quads) for body, quads in ((slave.body, own), (master.body, faces)))
    finer, coarser = widths
    return TiedNodes(
        slave=(nodes + first[slave.body]).astype(np.int32),
        master=(faces[found.face] + first[master.body]).astype(np.int32),
        weight=found.weight,
        facts=(
            {
                "slave": f"{slave.body}:{slave.nodes}",
                "master": f"{master.body}:{master.nodes}",
                "nodes": len(nodes),
                "gap": float(found.distance.max()),
                "beyond": float(found.beyond.max()),
                "size_ratio": coarser / finer,
            },
        ),
    )


def _edge(X: Array, faces: Index) -> float:
    """Usual edge of faces [m]."""
    corner = X[faces]
    return float(np.median(np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)))


def on_faces(ties: TiedNodes, scene: Scene, X: Mapping[str, Array]) -> Mapping[str, Array]:
    """Positions with each slave on its face; a share `Tie.gap` of a face's edge is the most that one moves."""
    if not len(ties):
        return X
    placed = ties.follow(np.concatenate([X[body.name] for body in scene.bodies]))
    ends = np.cumsum([len(X[body.name]) for body in scene.bodies])[:-1]
    return {body.name: part for body, part in zip(scene.bodies, np.split(placed, ends), strict=True)}


def velocities(ties: TiedNodes, scene: Scene, X: Mapping[str, Array], V: Mapping[str, Array]) -> Array:
    """Velocities [m/s] of all nodes, shape (node_count, 3), float64; slaves have those of their places on the faces.

    Arguments as of `tied_nodes`, before slaves are moved onto the faces.

    Raises:
        RequestError: a slave moves against its master.
    """
    velocity = np.concatenate([V[body.name] for body in scene.bodies])
    if not len(ties):
        return velocity
    position = np.concatenate([X[body.name] for body in scene.bodies])
    apart, off = (np.linalg.norm(own[ties.slave] - ties.place(own), axis=1) for own in (velocity, position))
    node = np.concatenate([np.arange(len(X[body.name])) for body in scene.bodies])[ties.slave]
    ends = np.cumsum(np.array([fact["nodes"] for fact in ties.facts], dtype=int))[:-1]
    for tie, *own in zip(scene.ties, *(np.split(part, ends) for part in (node, apart, off)), strict=True):
        _check_motion(tie, X, V, *own)
    return ties.follow(velocity)


def _check_motion(
    tie: Tie, X: Mapping[str, Array], V: Mapping[str, Array], node: Index, apart: Array, off: Array
) -> None:
    """Refuse slaves that move against their masters.

    In one rigid motion, which turns with omega, a slave at d from its place moves against it with omega x d, at most
    |omega| |d|. Of `node` in the slave's body, `apart` is the difference of velocities [m/s] and `off` is |d| [m].
    """
    bodies = tie.slave.body, tie.master.body
    turn = max(float(np.linalg.norm(mean_spin(X[name], V[name], np.ones(len(X[name]))))) for name in bodies)
    speed = max(float(np.linalg.norm(V[name], axis=1).max()) for name in bodies)
    over = apart - TURNING * turn * off
    k = int(over.argmax())
    if over[k] > MOVING * speed:
        remedy = (
            f"a slave moves against its master at the start: node {node[k]} of {tie.slave.body} by {apart[k]:.3g} m/s, "
            f"where turning with {turn:.3g} rad/s at a gap of {off[k]:.3g} m explains {turn * off[k]:.3g} m/s; give "
            "tied bodies one motion"
        )
        raise bad_value(f"{tie.title}.slave", tie.slave.nodes, remedy)


def within_body(scene: Scene, meshes: Mapping[str, Mesh], body: str) -> tuple[Array, TiedNodes]:
    """Nodes of a body in its frame [m], slaves of ties within it on their faces, and these ties."""
    own, points = [tie for tie in scene.ties if tie.slave.body == tie.master.body == body], meshes[body].points
    ties = join_ties([_tied(tie, meshes, {body: points}, {body: 0}) for tie in own])
    return (ties.follow(points) if len(ties) else points), ties


def check_ties(ties: TiedNodes, held: Mapping[str, NDArray], moved: Sequence[Index]) -> None:
    """Refuse slaves and masters that something else moves, as `moved` nodes, and slaves that are fixed by themselves.

    A slave may be fixed along an axis where all of its masters are: it stays at rest with them.

    Raises:
        RequestError: there is such a node.
    """
    if not len(ties):
        return
    driven = np.concatenate([held["prescribed_node"], *moved])
    bad = np.isin(ties.slave, driven) | (np.isin(ties.master, driven) & (ties.weight != 0.0)).any(axis=1)
    if bad.any():
        what = "a tied node is also in a joint or driven, absorbing or of a rigid body"
        raise RequestError(f"{ties.title(bad)}: {what}; bind other nodes, off the tie")
    fixed = held["fixed_axes"]
    shared = np.bitwise_and.reduce(np.where(ties.weight != 0.0, fixed[ties.master], 7), axis=1)
    bad = (fixed[ties.slave] & ~shared) != 0
    if bad.any():
        raise RequestError(f"{ties.title(bad)}: a slave node is fixed where its masters are free; fix the masters, too")
