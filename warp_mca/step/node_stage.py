"""Owns the nodal stages: free nodes gather their forces and move, then nodes in joints and driven ones."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.nodes import constraint, node, slide
from warp_mca.kernels.nodes.gather import Kind, NodeData, NodeState
from warp_mca.physics.contact.per_scene import per_scene
from warp_mca.physics.elements.stage import BLOCK_DIM
from warp_mca.system.actor import Actor, When
from warp_mca.system.stage import Stage, Step
from warp_mca.system.threads import NODES, Split, whole
from warp_mca.system.weight import nodal_gravity

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver
    from warp_mca.system.state import State

# Patches that a block of threads computes in turn, from which on blocks take their places while nodes are advanced:
# they do not spread evenly then, and few rounds do not level that out.
EARLY_ROUNDS = 8


class NodeStage(Actor):
    """Advances all nodes by a step of central differences.

    Attributes:
        dt: time step of bound nodes [s].
        base: time step of the fastest nodes [s].
        kind: what the kernels of all nodes are compiled for; with `kind.each`, `gravity` and `scene` are arrays.
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
        turned = work.frame is not None
        self.kind = Kind(solver.precision, len(work.nodal_force) > 0, each, self.rated, turned)
        self._choose(bool(model.fixed_axes.any()), rounds >= EARLY_ROUNDS)

    def _choose(self, fixed: bool, early: bool) -> None:
        """The kernels; `fixed` and `early` as `node.integrate_kernel` has them."""
        own = self.constraints
        self.integrate_kernel = node.integrate_kernel(self.kind, fixed, own.bound, early)
        self.bound_kernel = None
        if own.count:
            self.bound_kernel = constraint.bound_kernel(self.kind, own.partial, own.skips, own.driven > 0)

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.integrate_kernel, *([self.bound_kernel] if self.bound_kernel else [])]

    def stages(self, when: When) -> Iterable[Stage]:
        """Free nodes, beside bound ones."""
        yield Stage("advance", "free nodes", lambda s: self.advance_free(s, when.level, when.chain))

    def advance_free(self, step: Step, level: int | None = None, chain: int | None = None) -> None:
        """Free nodes, those up to a `level` of `Model.rates` or all; of one `chain` or all."""
        self.integrate(step.state, self.base, self.base, self.constraints.role, step.split, step.records, level, chain)

    def slots(self, level: int | None) -> tuple[wp.array, wp.array]:
        """`first_slots` and `more_slots` of elements up to a level, or of all."""
        return self.work.first_slots, self.work.more_slots

    def given(self, state: State, level: int | None = None, role: wp.array | None = None) -> list[Any]:
        """What kernels that move nodes read, with forces of elements up to a level, or of all; `role` by default that
        of the model's constraints."""
        work, found = self.work, NodeData()
        found.mass, found.inverse_mass, found.frames = work.mass, work.inverse_mass, work.frames(state)
        found.first_slots, found.more_slots = self.slots(level)
        found.role = self.constraints.role if role is None else role
        return [found, work.force]

    def moved(self, state: State, records: bool = False) -> Any:
        """What they write; where the step records, `Workspace.v_before` takes the velocities before it."""
        found = NodeState()
        found.nodal_force, found.u, found.v = self.work.nodal_force, state.u, state.v
        found.speed_square = state.speed_square
        if records:
            found.v_before = self.work.v_before
        return found

    def at_record(self, state: State) -> tuple[wp.array, wp.array, float]:
        """After the step that recorded: displacements [m], velocities before these [m/s], and the time [s] by which the
        displacements have moved on with them since the record."""
        return state.u, state.v, self.dt

    def advance_bound(self, step: Step, level: int | None = None) -> None:
        """Nodes in joints and driven ones, with forces of elements up to a level, or of all."""
        state, own = step.state, step.state.constraints
        inputs = [*self.given(state, level), self.scene, self.gravity, self.constraints.bonds, self.dt]
        outputs = [self.moved(state, step.records), own.impulse, own.work, own.work_after, own.clock]
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
        records: bool = False,
        level: int | None = None,
        chain: int | None = None,
    ) -> None:
        """v += kick a, u += drift v of nodes whose `role` leaves them free; a step that `records` keeps the old v."""
        inputs = [None, *self.given(state, None, role), self.scene, self.gravity, kick, drift]
        self._integrate(self.integrate_kernel, self.node_count, inputs, state, split, records, self.kind.pushed)

    def _integrate(
        self, kernel: Any, count: int, inputs: list[Any], state: State, split: Split, records: bool, pressed: bool
    ) -> None:
        """Launch a kernel for ranges of nodes; where these are `pressed`, it also keeps the greatest normal force."""
        first, data, *others = inputs
        read = [data.inverse_mass, data.first_slots, data.more_slots, data.role, data.frames]
        moved = self.moved(state, records)
        written = [moved.nodal_force, moved.u, moved.v, moved.v_before, moved.speed_square]

        def launch(part: slice) -> None:
            keepers = node.KEEPERS if pressed and len(state.normal_force) and part.start == 0 else 0
            outputs, threads = [*written, state.normal_force if keepers else None], part.stop - part.start + keepers
            given = [part.start, part.stop, first, *read, *others]
            wp.launch(kernel, threads, inputs=given, outputs=outputs, block_dim=BLOCK_DIM)

        split(count, launch, NODES)
