"""Owns the device side of what binds nodes: axes at rest, joints, driven axes; and which nodes may be touched."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.nodes import slide
from warp_mca.kernels.nodes.constraint import Bonds
from warp_mca.kernels.nodes.gather import BOUND, TOUCHABLE
from warp_mca.physics.rigid.bodies import moves_with_rigid, rigid_nodes
from warp_mca.system.actor import Actor, When
from warp_mca.system.stage import BESIDE, Stage

if TYPE_CHECKING:
    from warp_mca.system.actor import System


@dataclass(eq=False)
class ConstraintState:
    """State of joints and driven nodes.

    Attributes:
        impulse: that each joint's pair gave to its first node [N s], shape (pair_count,), vec3d.
        work: done on each driven node's axes up to t(n) [J], shape (driven_count,), vec3d.
        work_after: the same half a step later [J], shape (driven_count,), vec3d.
        clock: steps that each driven node has taken [-], shape (driven_count,), int32.
    """

    impulse: wp.array
    work: wp.array
    work_after: wp.array
    clock: wp.array


class ConstraintStage(Actor):
    """What `kernels.nodes.gather` and `kernels.nodes.constraint` read to advance bound nodes, and what they count.

    Attributes:
        count: tied pairs and driven nodes; 0 where all pairs hold nodes of rigid bodies.
        bound: whether the nodal stage leaves any node to others, those of ties, absorbing boundaries and rigid bodies
            included.
        partial: whether some pairs are tied in some directions only.
        skips: whether some pairs are not advanced here, because they hold nodes of a rigid body.
        rails: first slider, first node and end of each in `bonds.first`, shape (rail_count,), vec3i.
        bonds: pairs, driven nodes and their tables.
        role: of each node, shape (node_count,), uint8; empty where nothing is bound, at rest or touched.
        at_rest: the same of a model without joints, driven axes and absorbing boundaries, but with rigid bodies.
        pairs, driven: their numbers.
        driven_first: first driven node of each scene, and the number of all, shape (scene_count + 1,), int32.
    """

    def __init__(self, solver: System) -> None:
        """Allocate on the current device."""
        self.solver, model = solver, solver.model
        nodes, place = np.unique(model.prescribed_node, return_inverse=True)
        self.pairs, self.driven = len(model.joint_first), len(nodes)
        rigid = rigid_nodes(model)
        held = rigid[model.joint_first] | (rigid[model.joint_second] & (model.joint_second >= 0))  # by `RigidStage`
        self.count = 0 if held.all() and not self.driven else self.pairs + self.driven
        others = (model.absorbing.node, model.ties.slave, model.ties.carriers, np.flatnonzero(rigid))
        self.bound = self.count > 0 or any(map(len, others))
        role = model.fixed_axes.astype(np.uint8)
        for item in model.passes:
            role[item.slave] |= TOUCHABLE
            role[item.master] |= TOUCHABLE
            if model.fails:  # any node may come to the surface
                role |= TOUCHABLE
        for item in (item for items in model.loads.values() for item in items):
            role[item.node] |= TOUCHABLE
        if not self.bound and not role.any():
            role = role[:0]
        if model.rigid_bodies:
            role[moves_with_rigid(model)] |= BOUND  # forces on them at the start are those of rigid bodies
        self.at_rest = wp.array(role, dtype=wp.uint8)
        for bound in (model.joint_first, model.joint_second[model.joint_second >= 0], nodes, *others):
            role[bound] |= BOUND
        self.role = wp.array(role, dtype=wp.uint8)
        begin, end = (np.full((len(nodes), 3), -1, dtype=np.int32) for _ in range(2))
        begin[place, model.prescribed_axis] = model.table_offset[model.prescribed_table]
        end[place, model.prescribed_axis] = model.table_offset[model.prescribed_table + 1]
        self.bonds = Bonds()
        self.skips = bool(held.any())
        self.bonds.first = wp.array(np.where(held, -1, model.joint_first), dtype=wp.int32)
        self.bonds.second = wp.array(model.joint_second, dtype=wp.int32)
        self.partial = bool((model.joint_tied != np.eye(3)).any())
        self.bonds.tied = wp.array(model.joint_tied if self.partial else model.joint_tied[:0], dtype=wp.mat33d)
        self.rails = wp.array(model.joint_slides, dtype=wp.vec3i)
        self.bonds.node = wp.array(nodes, dtype=wp.int32)
        self.bonds.begin, self.bonds.end = wp.array(begin, dtype=wp.vec3i), wp.array(end, dtype=wp.vec3i)
        self.bonds.times = wp.array(model.table_time, dtype=wp.float64)
        self.bonds.values = wp.array(model.table_value, dtype=wp.float64)
        self.driven_first = wp.array(np.searchsorted(nodes, solver.layout.nodes), dtype=wp.int32)

    def new_state(self) -> ConstraintState:
        """State before the first step, on the current device."""
        return ConstraintState(
            impulse=wp.zeros(self.pairs, dtype=wp.vec3d),
            work=wp.zeros(self.driven, dtype=wp.vec3d),
            work_after=wp.zeros(self.driven, dtype=wp.vec3d),
            clock=wp.zeros(self.driven, dtype=wp.int32),
        )

    def record_kernels(self) -> list[Any]:
        """That of rails, which has blocks of Warp's own size; `NodeStage` has those of bound nodes."""
        return [slide.slide] if len(self.rails) else []

    def stages(self, when: When) -> Iterable[Stage]:
        """Nodes in joints and driven ones, then sliders, which have moved as free ones."""
        nodes = self.solver.nodes
        if when.common and self.count:
            yield Stage("advance", "joints, driven nodes", lambda s: nodes.advance_bound(s, when.level), BESIDE)
        if when.common and len(self.rails):
            yield Stage("advance", "sliders on rails", nodes.slide, BESIDE)
