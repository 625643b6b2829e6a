"""Owns what binds nodes: fixed and driven axes, and hinges as pairs of tied nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.geometry.mesh import Mesh
from warp_mca.model.assembly import GROUND, Array, Assembly, Index


@dataclass(frozen=True, kw_only=True)
class Hinge:
    """A revolute joint: pairs [start, end) of `Model.joint_first` and `joint_second`."""

    name: str
    start: int
    end: int


def constraints(parts: Assembly, V: Array) -> dict[str, NDArray]:
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
        drive(nodes, k, item.times, item.velocities)

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


def _axis_nodes(mesh: Mesh, at: Array, axis: Array, both_ends: bool) -> tuple[Index, Array]:
    """Nodes on a hinge axis, sorted along it, and their coordinates along it [m]."""
    axis = axis / np.linalg.norm(axis)
    offset = mesh.points - at
    along = offset @ axis
    away = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    nodes = np.flatnonzero(away <= 1e-6 * np.ptp(mesh.points, axis=0).max())
    nodes = nodes[np.argsort(along[nodes])]
    if both_ends:
        nodes = nodes[[0, -1]] if len(nodes) > 1 else nodes
    return nodes.astype(np.int32), along[nodes]


def join_bodies(parts: Assembly) -> tuple[Index, Index, tuple[Hinge, ...]]:
    """Pairs of tied nodes.

    Raises:
        RequestError: fewer than two nodes of a body lie on the axis, or the pairs do not coincide.
    """
    first, second, hinges = [], [], []
    for joint in parts.scene.joints:
        ends = joint.nodes == "ends"
        axis = np.asarray(joint.axis)
        a, along = _axis_nodes(parts.meshes[joint.body], np.asarray(joint.at), axis, ends)
        if len(a) < 2:
            raise bad_value(
                f"Revolute {joint.name}.at",
                joint.at,
                f"{len(a)} nodes of {joint.body} lie on this axis; two are needed",
            )
        a = a + parts.node_start[joint.body]
        b = np.full(len(a), GROUND, dtype=np.int32)
        if joint.other is not None:
            b, _ = _axis_nodes(parts.meshes[joint.other], np.asarray(joint.other_at), axis, ends)
            b = b + parts.node_start[joint.other]
            alike = len(a) == len(b)
            apart = float(np.linalg.norm(parts.X[a] - parts.X[b], axis=1).max()) if alike else np.inf
            if apart > 1e-6 * np.ptp(along):
                what = f"{len(a)} nodes of {joint.body} and {len(b)} of {joint.other}, up to {apart:.3g} m apart"
                raise bad_value(
                    f"Revolute {joint.name}.nodes",
                    joint.nodes,
                    f"they do not coincide ({what}); mesh both alike at the axis",
                )
            parts.X[b] = parts.X[a]
        start = sum(len(item) for item in first)
        hinges.append(Hinge(name=joint.name, start=start, end=start + len(a)))
        first.append(a)
        second.append(b)
    if not first:
        return np.zeros(0, np.int32), np.zeros(0, np.int32), ()
    pairs = np.concatenate(first), np.concatenate(second)
    tied = np.concatenate([pairs[0], pairs[1][pairs[1] != GROUND]])
    if len(np.unique(tied)) < len(tied):
        raise RequestError("Scene.joints: a node is tied twice; give each joint, of two bodies, an axis of its own")
    return pairs[0].astype(np.int32), pairs[1].astype(np.int32), tuple(hinges)


def check_bindings(held: dict[str, NDArray], first: Index, second: Index) -> None:
    """Refuse nodes on hinges that are fixed or driven too: each stage would undo what the other set.

    Raises:
        RequestError: there is such a node.
    """
    bound = held["fixed_axes"] != 0
    bound[held["prescribed_node"]] = True
    if bound[first].any() or bound[second[second != GROUND]].any():
        raise RequestError("Scene.joints: a node on a hinge is also fixed or driven; bind other nodes of that body")
