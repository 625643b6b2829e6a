"""Owns `Model`: a scene, its meshes and its initial motion as flat arrays that never change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from warp_mca.base.arrays import Array, Index
from warp_mca.base.joining import ALONE, AS_IS, GIVEN, ITEMS, PART, joinable, of, offsets_of
from warp_mca.system.absorbing import AbsorbingNodes
from warp_mca.system.block import Block
from warp_mca.system.body_joints import BodyJoint
from warp_mca.system.contact import ChosenPenalty, ContactPass
from warp_mca.system.floating import FloatingFrames
from warp_mca.system.joints import Coupling, JointPairs
from warp_mca.system.layout import Layout
from warp_mca.system.loads import HingeLoad, LoadedNodes, MovableBase
from warp_mca.system.rigid import RigidBody, RigidPin, RigidRow
from warp_mca.system.ties import TiedNodes
from warp_mca.system.time_step import MassScaling, Rates, StableStep


@joinable
@dataclass(frozen=True, kw_only=True)
class Model:
    """Everything the solver needs, as host arrays.

    Attributes:
        X: reference positions, those at hand-off [m], shape (node_count, 3), float64.
        V: initial velocities [m/s], shape (node_count, 3), float64.
        mass: lumped masses [kg], shape (node_count,), float64; slaves of ties have none, their masters carry it.
        blocks: elements by kernel.
        law: parameters of each material, as `Elastic.parameters` has them, then zeros, shape (material_count,
            parameters of the longest), float64.
        fixed_axes: bits 0, 1, 2 hold the axes x, y, z of each node, shape (node_count,), int32.
        prescribed_node, prescribed_axis, prescribed_table: one entry for each driven axis of a node, int32.
        table_offset: start of each table, shape (table_count + 1,), int32.
        table_time, table_value: [s] and [m/s], float64.
        joint_first, joint_second: tied nodes, shape (pair_count,), int32; GROUND has no second node.
        joint_tied: orthogonal projector on the directions in which pairs move as one [-], shape (pair_count, 3, 3),
            float64.
        joint_slides: of each rail the first of its sliders, the first of its own nodes and the end of these in
            `joint_first`, shape (rail_count, 3), int32. They count as pairs that are tied in no direction.
        joints: name of each joint and its pairs.
        couplings: of joints between clusters of nodes; their pairs count as tied in no direction. Those of rigid bodies
            are in `rigid_rows` and `rigid_pins`.
        hinge_loads: torques and friction in hinges of chains; those of each scene in turn.
        bases: of chains, that move or slide; their pairs count as tied in no direction.
        loads: on nodes, by kind; those of each scene in turn.
        absorbing: nodes of absorbing boundaries.
        ties: nodes tied to faces.
        passes: contact passes; those of each scene in turn.
        contact_axes: normal and tangent along which forces of each contact are reported [-], shape (contact_count, 2,
            3), float64; a closed master has no normal, which is zero then: normal forces add up as they are.
        penalties: what was chosen for each contact; None where the scene gives it.
        gravity: of each scene [m/s^2], shape (scene_count, 3), float64.
        points: nodes whose velocity is recorded (tip, target, others; those of each scene in turn), shape
            (point_count,), int32; GROUND where there is none.
        node_start, element_start: first node and element of each body in the concatenated meshes, by name.
        element_of: position of each element in the concatenated meshes, shape (element_count,), int32.
        stable: the stable time step.
        scaling: what mass scaling added to `mass`, or None.
        batch: where the scenes of a batch lie, or None for a model of one scene.
        rigid_bodies, rigid_rows, rigid_pins: rigid bodies, those of each scene in turn, and what binds them.
        body_joints: joints between whole bodies, of which a rigid one.
        rigid_blocks: their elements, which are shown but not computed; `element_of` lists them behind the others. Empty
            in a batch.
        rates: groups of elements that take steps of their own, or None where all take the same.
        floating: frames that elements compute in, or None where they do in the world frame.
    """

    X: Array = field(metadata=AS_IS)
    V: Array = field(metadata=AS_IS)
    mass: Array = field(metadata=AS_IS)
    blocks: tuple[Block, ...] = field(metadata=GIVEN)
    law: Array = field(metadata=GIVEN)
    fixed_axes: Index = field(metadata=AS_IS)
    prescribed_node: Index = field(metadata=of("nodes"))
    prescribed_axis: Index = field(metadata=AS_IS)
    prescribed_table: Index = field(metadata=of("tables"))
    table_offset: Index = field(metadata=offsets_of("table entries"))
    table_time: Array = field(metadata=AS_IS)
    table_value: Array = field(metadata=AS_IS)
    joint_first: Index = field(metadata=of("nodes"))
    joint_second: Index = field(metadata=of("nodes"))
    joint_tied: Array = field(metadata=AS_IS)
    joint_slides: Index = field(metadata=of("pairs"))
    joints: tuple[JointPairs, ...] = field(metadata=ITEMS)
    couplings: tuple[Coupling, ...] = field(metadata=ITEMS)
    hinge_loads: tuple[HingeLoad, ...] = field(metadata=ITEMS)
    bases: tuple[MovableBase, ...] = field(metadata=ITEMS)
    absorbing: AbsorbingNodes = field(metadata=PART)
    ties: TiedNodes = field(metadata=PART)
    passes: tuple[ContactPass, ...] = field(metadata=ITEMS)
    contact_axes: Array = field(metadata=AS_IS)
    penalties: tuple[ChosenPenalty | None, ...] = field(metadata=AS_IS)
    gravity: Array = field(metadata=AS_IS)
    points: Index = field(metadata=of("nodes"))
    node_start: Mapping[str, int] = field(metadata=GIVEN)
    element_start: Mapping[str, int] = field(metadata=GIVEN)
    element_of: Index = field(metadata=GIVEN)
    stable: StableStep = field(metadata=GIVEN)
    scaling: MassScaling | None = field(default=None, metadata=GIVEN)
    batch: Layout | None = field(default=None, metadata=GIVEN)
    rigid_bodies: tuple[RigidBody, ...] = field(default=(), metadata=ITEMS)
    rigid_rows: tuple[RigidRow, ...] = field(default=(), metadata=ITEMS)
    rigid_pins: tuple[RigidPin, ...] = field(default=(), metadata=ITEMS)
    body_joints: tuple[BodyJoint, ...] = field(default=(), metadata=ITEMS)
    rigid_blocks: tuple[Block, ...] = field(default=(), metadata=GIVEN)
    rates: Rates | None = field(default=None, metadata=ALONE)
    loads: Mapping[str, tuple[LoadedNodes, ...]] = field(default_factory=dict, metadata=ITEMS)
    floating: FloatingFrames | None = field(default=None, metadata=ALONE)

    def owner(self, element: int) -> tuple[str, int]:
        """Body that an element of the concatenated meshes belongs to, and the element's index in that body's mesh."""
        first, name = max((first, name) for name, first in self.element_start.items() if first <= element)
        return name, element - first

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return len(self.X)

    @property
    def viscous(self) -> bool:
        """Whether elements have bulk viscosity."""
        return any(block.viscous for block in self.blocks)

    @property
    def fails(self) -> bool:
        """Whether elements may fail."""
        return any(block.failing for block in self.blocks)

    @property
    def common_steps(self) -> int:
        """Steps that contacts and joints take in a step of the solver."""
        return self.rates.common_steps if self.rates else 1

    @property
    def element_count(self) -> int:
        """Number of elements that are computed."""
        return sum(block.conn.shape[1] for block in self.blocks)
