"""Owns the launch of many steps at once, for models that a GPU holds whole: see `kernels.resident.steps`.

Blocks of threads wait for each other, so that all must be on the device together: captured graphs launch the kernel as
a cooperative one, which the driver refuses otherwise. CUDA Driver API, "Graph Management".
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.elements.patch_stage import PatchStage
from warp_mca.kernels.contact.contact import LANES
from warp_mca.kernels.contact.laws import LINEAR
from warp_mca.kernels.contact.nearest import Master
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.resident.bound_role import MOST_BOUND
from warp_mca.kernels.resident.contact_role import Slaves
from warp_mca.kernels.resident.master_role import Faces
from warp_mca.kernels.resident.meeting import COUNTS
from warp_mca.kernels.resident.node_role import Nodes
from warp_mca.kernels.resident.patch_role import RESIDENT, THREADS
from warp_mca.kernels.resident.steps import Roles, resident_kernel
from warp_mca.model.patches import PATCH
from warp_mca.solve.contact_stage import ContactStage

if TYPE_CHECKING:
    from warp_mca.solve.solver import Solver
    from warp_mca.solve.state import State

STAGES = {"element forces", "contact", "joints, driven nodes", "free nodes"}  # that the kernel knows
MOST_FREE = 4  # nodes that a thread moves in turn at most


def blocks_of(threads: int) -> int:
    """Blocks of which PATCH threads take part."""
    return -(-threads // PATCH)


def surface_of(solver: Solver) -> ContactStage | None:
    """The only contact pass of a model, if that is one with a surface."""
    stages = solver.contacts
    return stages[0] if stages else None


def is_known(solver: Solver) -> bool:
    """Whether the kernel knows all that a model has."""
    _frames, *groups = solver.groups  # frames it knows
    stages = {stage.name for group in groups for stage in group if not stage.only_records}
    if solver.model.rates or solver.model.scaling:
        return False
    if not stages <= STAGES or solver.layout.count > 1 or len(solver.elements) > 1 or len(solver.contacts) > 1:
        return False
    (elements,) = solver.elements
    if not isinstance(elements, PatchStage) or elements.block.element != "hex8":
        return False
    if solver.constraints.count > MOST_BOUND:
        return False
    contact = surface_of(solver)
    if contact is None:
        return True
    bound = np.concatenate([contact.items[0].master, contact.items[0].slave, _bound(solver)])
    return not contact.on_plane and contact.sides == 1 and len(np.unique(bound)) == len(bound)


def _bound(solver: Solver) -> np.ndarray:
    model = solver.model
    second = model.joint_second[model.joint_second >= 0]
    return np.unique(np.concatenate([model.joint_first, second, model.prescribed_node])).astype(np.int32)


class Resident:
    """Takes many steps in one launch.

    Attributes:
        kernel: that takes them.
        roles: which blocks of threads do what.
        blocks: their number.
    """

    def __init__(self, solver: Solver, roles: Any) -> None:
        """Allocate on the current device; `roles` are those of `roles_of`."""
        self.solver, self.roles, self.blocks = solver, roles, int(roles.end)
        contact, block = surface_of(solver), solver.elements[0].block
        item = contact.items[0] if contact else None
        friction, stress_free = (item.mu > 0.0, contact.stress_free) if item and contact else (False, False)
        self.kernel = resident_kernel(
            solver.precision,
            block.law,
            solver.nodes.turned,
            contact is not None,
            friction,
            stress_free,
            contact.law if contact else LINEAR,
            solver.constraints.partial,
        )
        self.count = wp.zeros(COUNTS, dtype=wp.int32)
        self.nodes = _nodes(solver)

    def kernels(self) -> tuple[list[Any], int]:
        """The kernel, and the threads of its blocks."""
        return [self.kernel], THREADS

    def launch(self, state: State, steps: int) -> None:
        """Advance so many steps that record nothing."""
        solver, work, elements = self.solver, self.solver.work, self.solver.elements[0]
        own, bonds = state.elements[0], state.constraints
        slaves, master, faces, spring = _contact(solver, state)
        self.nodes.frames = work.frames(state)
        assert isinstance(elements, PatchStage)
        inputs = [self.roles, steps, work.X, elements.point, elements.patches, work.law, elements.slot, self.nodes]
        inputs += [slaves, master, faces, solver.constraints.bonds, solver.dt, spring]
        outputs = [self.count, own.yielded, own.history, own.extreme, work.force, work.contact_force]
        outputs += [state.normal_force, state.u, state.v, state.speed_square]
        outputs += [bonds.impulse, bonds.work, bonds.work_after, bonds.clock, state.flag]
        wp.launch(self.kernel, self.blocks * THREADS, inputs=inputs, outputs=outputs, block_dim=THREADS)


def resident(solver: Solver) -> Resident | None:
    """The launch of many steps at once, if the model is such that the device holds it whole."""
    if not wp.get_device().is_cuda or not is_known(solver):
        return None
    roles = roles_of(solver)
    return Resident(solver, roles) if roles else None


def roles_of(solver: Solver) -> Any:
    """Which blocks of threads do what; None if the device does not hold them all at once."""
    (elements,), contact, constraints = solver.elements, surface_of(solver), solver.constraints
    assert isinstance(elements, PatchStage)
    most = wp.get_device().sm_count * RESIDENT
    if len(elements.patches.head) > wp.get_device().sm_count:
        return None  # patches would wait for each other
    roles = Roles()
    roles.contact = len(elements.patches.head)
    roles.master = roles.contact + (blocks_of(LANES * len(contact.slave)) if contact else 0)
    roles.bound = roles.master + (blocks_of(LANES * len(contact.master)) if contact else 0)
    roles.free = roles.bound + (1 if contact or constraints.count else 0)
    masters = len(contact.master) if contact else 0
    wanted = blocks_of(solver.model.node_count - masters - len(_bound(solver)))
    roles.end = min(most, roles.free + wanted)
    if roles.end - roles.free < wanted / MOST_FREE:
        return None
    return roles


def _nodes(solver: Solver) -> Any:
    work, contact = solver.work, surface_of(solver)
    others = [_bound(solver)] + ([contact.items[0].master] if contact else [])
    free = np.setdiff1d(np.arange(solver.model.node_count), np.concatenate(others))
    found = Nodes()
    found.mass, found.inverse_mass, found.role = work.mass, work.inverse_mass, solver.constraints.role
    found.first_slots, found.more_slots = work.first_slots, work.more_slots
    found.free = wp.array(free, dtype=wp.int32)
    found.gravity = wp.vec3d(*solver.model.gravity[0])
    return found


def _contact(solver: Solver, state: State) -> tuple[Any, Any, Any, Any]:
    """What the kernel takes of the contact pass; empty if there is none."""
    stage = surface_of(solver)
    slaves, master, faces, spring = Slaves(), Master(), Faces(), Spring()
    if stage:
        own = state.contacts[0]
        slaves.node, slaves.stiffness, slaves.u_search = stage.slave, stage.stiffness, own.u_search
        slaves.mu, slaves.margin, slaves.per_newton = stage.mu, stage.margin, stage.per_newton
        master, spring = stage.faces_of(own), own.spring
        faces.master, faces.offset, faces.of_node = stage.master, stage.face_offset, stage.face_of_node
        faces.face, faces.count, faces.slave = stage.face, own.face_count, own.face_slave
        faces.u_search, faces.margin = own.u_search, stage.margin
    return slaves, master, faces, spring
