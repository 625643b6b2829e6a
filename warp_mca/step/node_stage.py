"""Owns the nodal stages: free nodes gather their forces and move, then nodes in joints and driven ones."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.nodes import constraint, node, rated_node, slide
from warp_mca.physics.actor import Actor, When
from warp_mca.physics.contact.stage import per_scene
from warp_mca.physics.elements.stage import BLOCK_DIM
from warp_mca.physics.loads.weight import nodal_gravity
from warp_mca.step.stage import Stage, Step
from warp_mca.step.threads import NODES, Split, whole

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver
    from warp_mca.step.state import State

# Patches that a block of threads computes in turn, from which on blocks take their places while nodes are advanced:
# they do not spread evenly then, and few rounds do not level that out.
EARLY_ROUNDS = 8


class NodeStage(Actor):
    """Advances all nodes by a step of central differences.

    Attributes:
        dt: time step of bound nodes [s].
        base: time step of the fastest nodes [s].
        each: whether gravity differs between nodes; then `gravity` and `scene` are arrays.
        touched: whether there is contact.
        turned: whether elements compute in floating frames.
        rated: whether elements take steps of their own.
        integrate_kernel, bound_kernel: of free and of bound nodes; None where no node is bound.
    """

    rated = False

    block_dim = BLOCK_DIM

    def __init__(self, solver: Solver, rounds: int) -> None:
        """Choose the kernels; `rounds` of elements that wait for nothing but the nodes."""
        model, work = solver.model, solver.work
        self.work, self.constraints, self.node_count = work, solver.constraints, model.node_count
        self.dt = self.base = solver.common_dt
        each = bool((model.gravity != model.gravity[0]).any())
        self.gravity = work.gravity if each else wp.vec3d(*model.gravity[0])
        layout_nodes = model.batch.nodes if model.batch else None
        self.scene = per_scene(layout_nodes) if each and layout_nodes is not None else 0
        if (own := nodal_gravity(model)) is not None:  # each node is a scene of its own then
            each, self.gravity = True, wp.array(own, dtype=wp.vec3d)
            self.scene = wp.array(np.arange(model.node_count), dtype=wp.int32)
        self.touched, fixed = len(work.contact_force) > 0, bool(model.fixed_axes.any())
        self.turned = work.frame is not None
        self.each, early = each, rounds >= EARLY_ROUNDS
        self._choose(solver.precision, (self.touched, fixed, early))

    def _choose(self, precision: str, kind: tuple[bool, bool, bool]) -> None:
        """The kernels of a `kind`: contact, fixed, early as `node.integrate_kernel` has them."""
        (contact, fixed, early), own, each = kind, self.constraints, self.each
        make = rated_node.integrate_kernel if self.rated else partial(node.integrate_kernel, turned=self.turned)
        self.integrate_kernel = make(precision, contact, fixed, own.bound, each, early)
        self.bound_kernel = (
            constraint.bound_kernel(precision, contact, each, own.partial, own.skips, self.rated, self.turned)
            if own.count
            else None
        )

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.integrate_kernel, *([self.bound_kernel] if self.bound_kernel else [])]

    def advance(self, when: When) -> Iterable[Stage]:
        """Free nodes, once bound ones have read their forces."""
        yield Stage("free nodes", lambda s: self.advance_free(s, when.level, when.chain))

    def advance_free(self, step: Step, level: int | None = None, chain: int | None = None) -> None:
        """Free nodes, those up to a `level` of `Model.rates` or all; of one `chain` or all.

        Where the step records, `work.v_before` takes the velocities before it.
        """
        before = self.work.v_before if step.records else None
        self.integrate(step.state, self.base, self.base, self.constraints.role, step.split, before, level, chain)

    def slots(self, level: int | None) -> tuple[wp.array, wp.array]:
        """`first_slots` and `more_slots` of elements up to a level, or of all."""
        return self.work.first_slots, self.work.more_slots

    def at_record(self, state: State) -> tuple[wp.array, wp.array, float]:
        """After the step that recorded: displacements [m], velocities before these [m/s], and the time [s] by which the
        displacements have moved on with them since the record."""
        return state.u, state.v, self.dt

    def advance_bound(self, step: Step, level: int | None = None) -> None:
        """Nodes in joints and driven ones, with forces of elements up to a level, or of all."""
        work, state, own = self.work, step.state, step.state.constraints
        inputs = [work.mass, work.inverse_mass, *self.slots(level), self.constraints.role, work.force]
        inputs += [work.frames(state), self.scene, self.gravity, self.constraints.bonds, self.dt]
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
        level: int | None = None,
        chain: int | None = None,
    ) -> None:
        """v += kick a, u += drift v of nodes whose `role` leaves them free; `before` takes the old velocities."""
        work, squares = self.work, state.speed_square

        def launch(part: slice) -> None:
            scene = 0 if isinstance(self.scene, int) else self.scene[part]
            contact_force = work.contact_force[part] if self.touched else work.contact_force
            inputs = [work.inverse_mass[part], work.first_slots[part], work.more_slots]
            inputs += [role[part] if len(role) else role, work.force, work.frames(state, part)]
            inputs += [scene, self.gravity, kick, drift]
            outputs = [contact_force, state.u[part], state.v[part], None if before is None else before[part]]
            keepers = node.KEEPERS if self.touched and part.start == 0 else 0
            outputs += [squares[part] if len(squares) > 1 else squares, state.normal_force if keepers else None]
            threads = part.stop - part.start + keepers
            wp.launch(self.integrate_kernel, threads, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)

        split(self.node_count, launch, NODES)
