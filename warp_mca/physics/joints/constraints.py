"""Owns what binds nodes: fixed and driven axes, and joints as pairs of tied nodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.physics.joints.couplings import coupling
from warp_mca.scene.joints import Joint
from warp_mca.scene.ties import Clusters, Rails, Side, Ties
from warp_mca.system.bodies import GROUND, Bodies
from warp_mca.system.joints import Coupling, JointPairs
from warp_mca.system.ties import TiedNodes


def constraints(parts: Bodies, V: Array) -> dict[str, NDArray]:
    """Axes at rest as bits; driven axes, fixed ones that move included, as tables, because they do work.

    Raises:
        RequestError: an axis of a node is driven twice, or fixed and driven: each stage would undo what the other set.
    """
    fixed_axes = np.zeros(len(parts.X), dtype=np.int32)
    bound = np.zeros((len(parts.X), 3), dtype=bool)
    node, axis, table = [], [], []
    offset, time, value = [0], [], []

    def drive(nodes: Index, k: int, times: tuple[float, ...], values: tuple[float, ...]) -> None:
        node.append(nodes)
        axis.append(np.full(len(nodes), k))
        table.append(np.full(len(nodes), len(offset) - 1))
        time.extend(times)
        value.extend(values)
        offset.append(len(time))

    for item in parts.scene.fixed:
        if parts.scene.body(item.body).rigid:
            continue  # rows hold them
        nodes = parts.nodes(item.body, item.nodes)
        for letter in item.axes:
            k = "xyz".index(letter)
            fixed_axes[nodes[V[nodes, k] == 0.0]] |= 1 << k
            new = nodes[~bound[nodes, k]]  # the others are fixed already, at the same speed
            bound[nodes, k] = True
            for speed in np.unique(V[new, k]):
                if speed != 0.0:
                    drive(new[V[new, k] == speed], k, (0.0,), (float(speed),))
    for item in parts.scene.prescribed:
        nodes, k = parts.nodes(item.body, item.nodes), "xyz".index(item.axis)
        if bound[nodes, k].any():
            what = f"axis {item.axis} of some of these nodes of body {item.body} is bound twice"
            raise bad_value("Prescribed.nodes", item.nodes, f"{what}, by another Prescribed or Fixed; bind it once")
        bound[nodes, k] = True
        drive(nodes, k, *item.velocity_table)

    def join(items: list[NDArray]) -> Index:
        return np.concatenate(items).astype(np.int32) if items else np.zeros(0, np.int32)

    return {
        "fixed_axes": fixed_axes,
        "prescribed_node": join(node),
        "prescribed_axis": join(axis),
        "prescribed_table": join(table),
        "table_offset": np.array(offset, dtype=np.int32),
        "table_time": np.array(time, dtype=np.float64),
        "table_value": np.array(value, dtype=np.float64),
    }


def _side(parts: Bodies, body: str) -> Side:
    mesh, start = parts.meshes[body], parts.node_start[body]
    return Side(body, mesh, parts.X[start : start + len(mesh.points)], rotation_matrix(parts.scene.body(body).rotation))


@dataclass(frozen=True)
class _Tied:
    """A joint's pairs in the model's numbering, as in `Model`; `slides` counts from the joint's first pair."""

    first: Index
    second: Index
    tied: Array
    slides: Index
    coupling: Coupling | None = None


def _tied_pairs(parts: Bodies, joint: Joint, start: int) -> _Tied:
    """What a joint ties, whose pairs begin at `start`."""
    if joint.whole() is not None:
        nodes = [parts.nodes(*own) for own in joint.sets().values()]
        a = np.concatenate([np.zeros(0, np.int32), *nodes])
        return _Tied(a, np.full(len(a), GROUND, dtype=np.int32), np.zeros((len(a), 3, 3)), np.zeros((0, 3), np.int32))
    side = _side(parts, joint.body)
    other = None if joint.other is None else _side(parts, joint.other)
    ties = validate.call(joint.title, "ties()", "it", _ties_of, joint, side, other)
    if isinstance(ties, Rails):
        return _on_rails(parts, joint, ties)
    if isinstance(ties, Clusters):
        return _coupled(parts, joint, ties, start)
    a = ties.first + parts.node_start[joint.body]
    b = np.full(len(a), GROUND, dtype=np.int32)
    if joint.other is not None:
        assert ties.second is not None
        b = ties.second + parts.node_start[joint.other]
        alike = len(a) == len(b)
        apart = float(np.linalg.norm(parts.X[a] - parts.X[b], axis=1).max()) if alike else np.inf
        if apart > side.tolerance:
            what = f"{len(a)} nodes of {joint.body} and {len(b)} of {joint.other}, up to {apart:.3g} m apart"
            remedy = (
                f"they do not coincide ({what}); let the joint's places in both bodies meet, and mesh both alike there"
            )
            raise bad_value(f"{joint.title}.{joint.place}", getattr(joint, joint.place), remedy)
        parts.X[b] = parts.X[a]
    tied = np.eye(3) if ties.tied is None else ties.tied
    if not (np.allclose(tied, tied.T) and np.allclose(tied @ tied, tied)):
        remedy = "its ties must give an orthogonal projector, as n n^T or I - a a^T of unit vectors"
        raise bad_value(f"{joint.title}.ties", tied.tolist(), remedy)
    return _Tied(a, b, np.broadcast_to(tied, (len(a), 3, 3)), np.zeros((0, 3), np.int32))


def _ties_of(joint: Joint, side: Side, other: Side | None) -> Ties | Rails | Clusters:
    """What a joint returns, with nodes that its bodies have."""
    ties = joint.ties(side, other)
    if not isinstance(ties, Ties | Rails | Clusters):
        raise TypeError(f"it gives a {type(ties).__name__}, not Ties, Rails or Clusters")
    of_both = (ties.sliders, ties.rails) if isinstance(ties, Rails) else ((ties.first,), (ties.second,))
    for owner, lists in zip((side, other), of_both, strict=True):
        for nodes in lists:
            if (nodes is None) != (owner is None):
                raise TypeError("it gives nodes of a second body just where the joint has none")
            if owner and nodes is not None and not np.isin(nodes, np.arange(len(owner.X))).all():
                raise IndexError(f"it names other nodes of {owner.body} than 0 to {len(owner.X) - 1}")
    return ties


def _on_rails(parts: Bodies, joint: Joint, ties: Rails) -> _Tied:
    """Sliders and nodes of each rail as pairs with the ground that are tied in no direction."""
    assert joint.other is not None
    nodes, slides, count = [], [], 0
    for slider, rail in zip(ties.sliders, ties.rails, strict=True):
        nodes += [slider + parts.node_start[joint.body], rail + parts.node_start[joint.other]]
        slides.append((count, count + len(slider), count + len(slider) + len(rail)))
        count = slides[-1][-1]
    ground = np.full(count, GROUND, dtype=np.int32)
    return _Tied(np.concatenate(nodes), ground, np.zeros((count, 3, 3)), np.array(slides, dtype=np.int32))


def _coupled(parts: Bodies, joint: Joint, clusters: Clusters, start: int) -> _Tied:
    """Nodes of both clusters as pairs with the ground that are tied in no direction."""
    bodies = [(joint.body, clusters.first), (joint.other, clusters.second)]
    sides: list[Side | None] = [None, None]
    masses: list[Array | None] = [None, None]
    nodes: list[Index] = []
    for k, (body, own) in enumerate(bodies):
        if body is not None and own is not None:
            first = parts.node_start[body]
            sides[k] = side = _side(parts, body)
            masses[k] = parts.mass[first : first + len(side.X)]
            nodes.append(own + np.int32(first))
    found = coupling(joint, clusters, sides, masses, start)
    a = np.concatenate(nodes)
    ground = np.full(len(a), GROUND, dtype=np.int32)
    return _Tied(a, ground, np.zeros((len(a), 3, 3)), np.zeros((0, 3), np.int32), found)


def join_bodies(parts: Bodies) -> tuple[dict[str, NDArray], tuple[JointPairs, ...], tuple[Coupling, ...]]:
    """Pairs of tied nodes as in `Model`, the joints that own them, and those of joints between clusters.

    Raises:
        RequestError: a joint finds no nodes, its pairs do not coincide, or a node is tied twice.
    """
    found, joints, start = [], [], 0
    slides = [np.zeros((0, 3), np.int32)]
    for joint in parts.scene.acting_joints:
        found.append(_tied_pairs(parts, joint, start))
        slides.append(found[-1].slides + np.int32(start))
        joints.append(JointPairs(name=joint.name, start=start, end=start + len(found[-1].first)))
        start = joints[-1].end
    pairs = {
        "joint_first": np.concatenate([np.zeros(0, np.int32), *(item.first for item in found)]).astype(np.int32),
        "joint_second": np.concatenate([np.zeros(0, np.int32), *(item.second for item in found)]).astype(np.int32),
        "joint_tied": np.concatenate([np.zeros((0, 3, 3)), *(item.tied for item in found)]),
        "joint_slides": np.concatenate(slides).astype(np.int32),
    }
    _check_shared(parts, joints, pairs)
    return pairs, tuple(joints), tuple(item.coupling for item in found if item.coupling is not None)


def _check_shared(parts: Bodies, joints: Sequence[JointPairs], pairs: dict[str, NDArray]) -> None:
    """Refuse nodes that are in two pairs: of two corrections at once neither would hold.

    Raises:
        RequestError: there is such a node.
    """
    nodes = nodes_of(pairs)
    found, count = np.unique(nodes, return_counts=True)
    if (count == 1).all():
        return
    node = int(found[count > 1][0])
    by = " and ".join(dict.fromkeys(_joints_of(parts, joints, pairs, node)))
    remedy = "let one joint take it, and the other one other nodes"
    raise RequestError(f"Scene.joints: a node is tied twice, that of {parts.where(node)}, by {by}; {remedy}")


def _joints_of(parts: Bodies, joints: Sequence[JointPairs], pairs: dict[str, NDArray], node: int) -> Iterator[str]:
    """Kind and name of the joints that have a node."""
    for joint, item in zip(parts.scene.acting_joints, joints, strict=True):
        if any(node in pairs[key][item.start : item.end] for key in ("joint_first", "joint_second")):
            yield joint.title


def nodes_of(pairs: dict[str, NDArray]) -> Index:
    """All nodes of the pairs, without the ground."""
    both = np.concatenate([pairs["joint_first"], pairs["joint_second"]])
    return both[both != GROUND]


def free_nodes(held: dict[str, NDArray], pairs: dict[str, NDArray], ties: TiedNodes) -> NDArray[np.bool_]:
    """Nodes that no joint or tie binds and nothing holds or drives, shape (node_count,)."""
    free = held["fixed_axes"] == 0
    free[held["prescribed_node"]] = False
    free[nodes_of(pairs)] = False
    free[ties.slave] = False
    free[ties.carriers] = False
    return free


def check_bindings(
    parts: Bodies, joints: Sequence[JointPairs], held: dict[str, NDArray], pairs: dict[str, NDArray]
) -> None:
    """Refuse nodes of joints that are fixed or driven too: each stage would undo what the other set.

    Raises:
        RequestError: there is such a node.
    """
    bound = held["fixed_axes"] != 0
    bound[held["prescribed_node"]] = True
    nodes = nodes_of(pairs)
    if bound[nodes].any():
        node = int(nodes[bound[nodes]][0])
        others = (*parts.scene.fixed, *parts.scene.prescribed)
        other = next(item for item in others if node in parts.nodes(item.body, item.nodes))
        by = f"by {next(_joints_of(parts, joints, pairs, node))} and {type(other).__name__} nodes {other.nodes}"
        what = f"a node of a joint is also fixed or driven, that of {parts.where(node)}, {by}"
        raise RequestError(f"Scene.joints: {what}; bind other nodes of that body")
