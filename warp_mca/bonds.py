"""Owns the device side of what binds nodes: axes at rest, hinges, driven axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from warp_mca.kernels import constraint
from warp_mca.layout import Layout

if TYPE_CHECKING:
    from warp_mca.model import Model


class BondStage:
    """Roles and tables that `kernels.node` reads while it advances the nodes, and what it counts.

    Attributes:
        fixed, hinged, driven: whether a node has an axis at rest, is in a hinge, has a driven axis.
        bonds: on the device.
        free: the same without hinges and driven axes.
        impulse: that each joint's pair gave to its first node [N s], shape (pair_count,), vec3d.
        work, work_after: done on each driven node's axes up to t(n), and half a step later [J], shape (driven_count,),
            vec3d.
        clock: steps that each driven node has taken, shape (driven_count,), int32.
        driven_first: first driven node of each scene, and the number of all, shape (scene_count + 1,), int32.
    """

    def __init__(self, model: Model, layout: Layout, mass: wp.array) -> None:
        """Allocate on the current device; `mass` of each node [kg]."""
        nodes, place = np.unique(model.prescribed_node, return_inverse=True)
        self.fixed = bool(model.fixed_axes.any())
        self.hinged, self.driven = len(model.joint_first) > 0, len(nodes) > 0
        at_rest = model.fixed_axes.astype(np.uint8)
        self.bonds, self.free = constraint.Bonds(), constraint.Bonds()
        if self.fixed or self.hinged or self.driven:
            role = at_rest.copy()
            role[model.joint_first] |= constraint.LEADS
            role[model.joint_second[model.joint_second >= 0]] |= constraint.FOLLOWS
            role[nodes] |= constraint.DRIVEN
            self.bonds.role, self.free.role = wp.array(role), wp.array(at_rest)
        if self.hinged or self.driven:
            entry = np.full(model.node_count, -1, dtype=np.int32)
            entry[model.joint_first] = np.arange(len(model.joint_first))
            entry[nodes] = np.arange(len(nodes))
            self.bonds.entry, self.bonds.mass = wp.array(entry), mass
            self.bonds.second = wp.array(model.joint_second, dtype=wp.int32)
        if self.driven:
            begin, end = (np.full((len(nodes), 3), -1, dtype=np.int32) for _ in range(2))
            begin[place, model.prescribed_axis] = model.table_offset[model.prescribed_table]
            end[place, model.prescribed_axis] = model.table_offset[model.prescribed_table + 1]
            self.bonds.begin, self.bonds.end = wp.array(begin, dtype=wp.vec3i), wp.array(end, dtype=wp.vec3i)
            self.bonds.times = wp.array(model.table_time, dtype=wp.float64)
            self.bonds.values = wp.array(model.table_value, dtype=wp.float64)
        self.impulse = wp.zeros(len(model.joint_first), dtype=wp.vec3d)
        self.work = wp.zeros(len(nodes), dtype=wp.vec3d)
        self.work_after = wp.zeros(len(nodes), dtype=wp.vec3d)
        self.clock = wp.zeros(len(nodes), dtype=wp.int32)
        self.driven_first = wp.array(np.searchsorted(nodes, layout.nodes), dtype=wp.int32)

    def counts(self) -> list[wp.array]:
        """The last outputs of the nodal kernel."""
        return [self.impulse, self.work, self.work_after, self.clock]
