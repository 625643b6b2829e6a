"""Owns the two launches of a substep in which a GPU moves the fastest nodes, where contact is theirs.

Patches and slave nodes are one launch, then master, bound and free nodes. As five launches, which part and join, they
take about twice as long (docs/decisions.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.elements.patch_stage import PatchStage
from warp_mca.kernels.contact.contact import LANES
from warp_mca.kernels.elements import hex8_touch
from warp_mca.kernels.nodes import touched_node
from warp_mca.kernels.nodes.node import BOUND, KEEPERS
from warp_mca.model.patches import PATCH
from warp_mca.solve.rated_nodes import RatedNodeStage
from warp_mca.solve.resident import contact_inputs, surface_of

if TYPE_CHECKING:
    from warp_mca.solve.solver import Solver
    from warp_mca.solve.stage import Step

BLOCK = touched_node.BLOCK_DIM
MERGED = {"joints, driven nodes", "free nodes"}  # stages that the second launch takes the place of


def _whole(threads: int) -> int:
    """Threads of whole blocks."""
    return -(-threads // BLOCK) * BLOCK


class FastChain:
    """Launches of the chain of level 0.

    Attributes:
        forces_kernel, motion_kernel: of the two launches.
        masters, bounds: threads of master and of bound nodes, in whole blocks.
        item: other nodes of level 0.
    """

    def __init__(self, solver: Solver) -> None:
        """Allocate on the current device, for a solver of which `fast_chain` knows all."""
        (self.elements,), (contact,), nodes, own = solver.elements, solver.contacts, solver.nodes, solver.constraints
        assert isinstance(self.elements, PatchStage) and isinstance(nodes, RatedNodeStage)
        self.solver, self.contact, self.nodes = solver, contact, nodes
        friction = contact.items[0].mu > 0.0
        self.forces_kernel = hex8_touch.force_kernel(
            solver.precision, self.elements.block.law, friction, contact.stress_free, contact.law
        )
        fixed = bool(solver.model.fixed_axes.any())
        self.motion_kernel = touched_node.motion_kernel(solver.precision, fixed, nodes.each, own.partial, own.skips)
        self.masters, self.bounds = _whole(LANES * len(contact.master)), _whole(own.count)
        level_0 = np.flatnonzero(nodes.rates.node_level == 0)
        self.item = nodes.items(np.setdiff1d(level_0, contact.items[0].master))

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.forces_kernel, self.motion_kernel]

    def forces(self, step: Step, level: int) -> None:
        """Forces of patches up to a level, and of slave nodes."""
        solver, work, state, elements = self.solver, self.solver.work, step.state, self.elements
        own, patches = state.elements[0], elements.chains[level, 0]
        slaves, master, _, spring = contact_inputs(solver, state)
        touching = -(-LANES * len(self.contact.slave) // PATCH)
        blocks = min(max(elements.most - touching, elements.most // 2), len(patches.head))
        inputs = [work.X, elements.point, patches, work.law, state.u, elements.slot, blocks, state.v]
        inputs += [slaves, master, self.nodes.dt, spring]
        outputs = [own.yielded, own.history, own.extreme, elements.flowing, work.force]
        outputs += [work.contact_force, state.normal_force[1], state.flag]
        wp.launch(self.forces_kernel, (blocks + touching) * PATCH, inputs=inputs, outputs=outputs, block_dim=PATCH)

    def motion(self, step: Step, level: int) -> None:
        """Nodes of level 0, after forces of elements up to a level."""
        solver, nodes, work, state, own = self.solver, self.nodes, self.solver.work, step.state, step.state.constraints
        _, _, faces, spring = contact_inputs(solver, state)
        inputs = [self.masters, self.bounds, self.item, work.mass, work.inverse_mass, *nodes.slots(level)]
        inputs += [solver.constraints.role, work.force, nodes.scene, nodes.gravity, solver.constraints.bonds, faces]
        inputs += [spring, nodes.dt]
        outputs = [work.contact_force, state.u, state.v, None, state.speed_square, state.normal_force, state.flag]
        outputs += [own.impulse, own.work, own.work_after, own.clock]
        threads = self.masters + self.bounds + _whole(len(self.item) + KEEPERS)
        wp.launch(self.motion_kernel, threads, inputs=inputs, outputs=outputs, block_dim=BLOCK)


def fast_chain(solver: Solver) -> FastChain | None:
    """The two launches, where they know all that elements and contact of the fastest nodes ask for."""
    rates, contact = solver.model.rates, surface_of(solver)
    if not rates or rates.common or not contact or solver.layout.count > 1:
        return None
    if len(solver.elements) > 1 or len(solver.contacts) > 1 or contact.on_plane or contact.sides > 1:
        return None
    (elements,) = solver.elements
    if not isinstance(elements, PatchStage) or elements.block.element != "hex8":
        return None
    role = solver.constraints.role.numpy()
    if not (rates.node_level == 0).any() or (role[contact.items[0].master] & BOUND).any():
        return None
    return FastChain(solver)
