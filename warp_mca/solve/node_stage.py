"""Owns the nodal stages: free nodes gather their forces and move, then nodes in joints and driven ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.elements.stage import BLOCK_DIM
from warp_mca.kernels.nodes import constraint, node, slide
from warp_mca.solve.contact_stage import per_scene
from warp_mca.solve.threads import NODES, Split, whole
from warp_mca.solve.weight import nodal_gravity

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.solve.constraint_stage import ConstraintStage
    from warp_mca.solve.stage import Step
    from warp_mca.solve.state import State
    from warp_mca.solve.workspace import Workspace

# Patches that a block of threads computes in turn, from which on blocks take their places while nodes are advanced:
# they do not spread evenly then, and few rounds do not level that out.
EARLY_ROUNDS = 8


class NodeStage:
    """Advances all nodes by a step of central differences.

    Attributes:
        each: whether gravity differs between the scenes of a batch; then `gravity` and `scene` are arrays.
        touched: whether there is contact.
        integrate_kernel, bound_kernel: of free and of bound nodes; None where no node is bound.
    """

    def __init__(
        self, model: Model, work: Workspace, constraints: ConstraintStage, precision: str, dt: float, rounds: int
    ) -> None:
        """Choose the kernels; `rounds` of elements that wait for nothing but the nodes."""
        self.work, self.constraints, self.dt, self.node_count = work, constraints, dt, model.node_count
        self.each = each = bool((model.gravity != model.gravity[0]).any())
        self.gravity = work.gravity if each else wp.vec3d(*model.gravity[0])
        layout_nodes = model.batch.nodes if model.batch else None
        self.scene = per_scene(layout_nodes) if each and layout_nodes is not None else 0
        if (own := nodal_gravity(model)) is not None:  # each node is a scene of its own then
            each, self.gravity = True, wp.array(own, dtype=wp.vec3d)
            self.scene = wp.array(np.arange(model.node_count), dtype=wp.int32)
        self.touched, fixed = len(work.contact_force) > 0, bool(model.fixed_axes.any())
        early = rounds >= EARLY_ROUNDS
        self.integrate_kernel = node.integrate_kernel(precision, self.touched, fixed, constraints.bound, each, early)
        self.bound_kernel = (
            constraint.bound_kernel(precision, self.touched, each, constraints.partial, constraints.skips)
            if constraints.count
            else None
        )

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.integrate_kernel, *([self.bound_kernel] if self.bound_kernel else [])]

    def advance(self, step: Step) -> None:
        """Free nodes; where the step records, `work.v_before` takes the velocities before it."""
        before = self.work.v_before if step.records else None
        self.integrate(step.state, self.dt, self.dt, self.constraints.role, step.split, before)

    def advance_bound(self, step: Step) -> None:
        """Nodes in joints and driven ones."""
        work, state, own = self.work, step.state, step.state.constraints
        inputs = [
            work.mass,
            work.inverse_mass,
            work.first_slots,
            work.more_slots,
            self.constraints.role,
            work.force,
            self.scene,
        ]
        inputs += [self.gravity, self.constraints.bonds, self.dt]
        outputs = [work.contact_force, state.u, state.v, work.v_before if step.records else None, state.speed_square]
        outputs += [own.impulse, own.work, own.work_after, own.clock]
        wp.launch(self.bound_kernel, self.constraints.count, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)

    def slide(self, step: Step) -> None:
        """Put sliders back on their rails, once all their nodes have moved as free ones."""
        state, constraints = step.state, self.constraints
        inputs = [self.work.X, self.work.mass, constraints.bonds.first, constraints.rails, self.dt]
        outputs = [state.u, state.v, state.speed_square, state.constraints.impulse]
        wp.launch(slide.slide, len(constraints.rails), inputs=inputs, outputs=outputs)

    def integrate(
        self,
        state: State,
        kick: float,
        drift: float,
        role: wp.array,
        split: Split = whole,
        before: wp.array | None = None,
    ) -> None:
        """v += kick a, u += drift v of nodes whose `role` leaves them free; `before` takes the old velocities."""
        work, squares = self.work, state.speed_square

        def launch(part: slice) -> None:
            scene = 0 if isinstance(self.scene, int) else self.scene[part]
            contact_force = work.contact_force[part] if self.touched else work.contact_force
            inputs = [work.inverse_mass[part], work.first_slots[part], work.more_slots]
            inputs += [role[part] if len(role) else role, work.force, scene, self.gravity, kick, drift]
            outputs = [contact_force, state.u[part], state.v[part], None if before is None else before[part]]
            keepers = node.KEEPERS if self.touched and part.start == 0 else 0
            outputs += [squares[part] if len(squares) > 1 else squares, state.normal_force if keepers else None]
            threads = part.stop - part.start + keepers
            wp.launch(self.integrate_kernel, threads, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)

        split(self.node_count, launch, NODES)
