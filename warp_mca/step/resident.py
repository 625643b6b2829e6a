"""Owns the launch of many steps at once, for models that a GPU holds whole: see `kernels.resident.steps`.

Blocks of threads wait for each other, so that all must be on the device together: captured graphs launch the kernel as
a cooperative one, which the driver refuses otherwise. CUDA Driver API, "Graph Management".
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.contact.contact import LANES
from warp_mca.kernels.contact.laws import PLAIN
from warp_mca.kernels.contact.nearest import Master
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.elements.patch_layout import PATCH
from warp_mca.kernels.nodes.cluster import Clusters
from warp_mca.kernels.nodes.constraint import Bonds
from warp_mca.kernels.resident.bound_role import MOST_BOUND
from warp_mca.kernels.resident.contact_role import Slaves
from warp_mca.kernels.resident.master_role import Faces
from warp_mca.kernels.resident.meeting import COUNTS
from warp_mca.kernels.resident.node_role import Nodes
from warp_mca.kernels.resident.patch_role import RESIDENT, THREADS
from warp_mca.kernels.resident.pin_role import MOST_PINNED
from warp_mca.kernels.resident.steps import Roles, resident_kernel
from warp_mca.physics.contact.stage import ContactStage
from warp_mca.physics.elements.patch_stage import PatchStage
from warp_mca.system.weight import nodal_gravity

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver
    from warp_mca.system.state import State

STAGES = {
    "nodes in floating frames",
    "element forces",
    "contact",
    "joints, driven nodes",
    "free nodes",
    "couplings: responses",
    "couplings",
}  # known
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
    stages = {stage.name for group in solver.groups for stage in group if not stage.only_records}
    if solver.model.rates:
        return False
    if not stages <= STAGES or solver.layout.count > 1 or len(solver.elements) > 1 or len(solver.contacts) > 1:
        return False
    (elements,) = solver.elements
    if not isinstance(elements, PatchStage) or not elements.lanes:
        return False
    if _tied(solver) + solver.constraints.driven > MOST_BOUND or not _pins_fit(solver):
        return False
    contact = surface_of(solver)
    if contact is None:
        return True
    bound = np.concatenate([contact.items[0].master, contact.items[0].slave, _bound(solver)])
    return not (contact.on_plane or contact.laws.bond) and contact.sides == 1 and len(np.unique(bound)) == len(bound)


def _pins_fit(solver: Solver) -> bool:
    """Whether clusters of pins are small enough, and no pairs of nodes are tied beside them."""
    pins = solver.couplings.items
    sizes = [size for pin in pins for size in (pin.middle - pin.start, pin.end - pin.middle)]
    return not pins or (max(sizes) <= MOST_PINNED and not _tied(solver))


def _tied(solver: Solver) -> int:
    """Tied pairs; those that stand for nodes of pins are none."""
    return solver.constraints.pairs - sum(pin.end - pin.start for pin in solver.couplings.items)


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
        (patches,) = solver.elements
        assert isinstance(patches, PatchStage)
        contact, block = surface_of(solver), patches.block
        item = contact.items[0] if contact else None
        friction = item is not None and item.mu > 0.0
        self.kernel = resident_kernel(
            patches.maker,
            solver.precision,
            block.law,
            block.joining,
            solver.nodes.kind.turned,
            contact is not None,
            friction,
            contact.laws if contact else PLAIN,
            solver.constraints.partial and not solver.couplings.count,
            solver.constraints.driven > 0,
            solver.couplings.count > 0,
        )
        self.count = wp.zeros(COUNTS, dtype=wp.int32)
        self.nodes, self.bonds = _nodes(solver), solver.constraints.bonds
        self.clusters = solver.couplings.clusters if solver.couplings.count else Clusters()
        if solver.couplings.count:  # whose nodes are no pairs here
            own, self.bonds = self.bonds, Bonds()
            self.bonds.node, self.bonds.begin, self.bonds.end = own.node, own.begin, own.end
            self.bonds.times, self.bonds.values = own.times, own.values

    def kernels(self) -> tuple[int, list[Any]]:
        """The threads of its blocks, and the kernel."""
        return THREADS, [self.kernel]

    def launch(self, state: State, steps: int) -> None:
        """Advance so many steps that record nothing."""
        solver, work, elements = self.solver, self.solver.work, self.solver.elements[0]
        own, bonds, pins = state.elements[0], state.constraints, state.couplings
        slaves, master, faces, spring = _contact(solver, state)
        self.nodes.data, force = solver.nodes.given(state)
        assert isinstance(elements, PatchStage)
        elements.patches.dt = elements.dt
        inputs = [self.roles, steps, work.X, elements.point, elements.patches, work.law, elements.slot, self.nodes]
        inputs += [slaves, master, faces, self.bonds, self.clusters, solver.dt, spring]
        outputs = [self.count, own.yielded, own.history, own.extreme, force, state.normal_force]
        outputs.append(solver.nodes.moved(state))
        outputs += [bonds.impulse, bonds.work, bonds.work_after, bonds.clock, pins.place, pins.orientation, state.flag]
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
    roles.pin = roles.bound + (1 if contact or constraints.count else 0)
    roles.free = roles.pin + solver.couplings.count
    masters = len(contact.master) if contact else 0
    wanted = blocks_of(solver.model.node_count - masters - len(_bound(solver)))
    roles.end = min(most, roles.free + wanted)
    if roles.end - roles.free < wanted / MOST_FREE:
        return None
    return roles


def _nodes(solver: Solver) -> Any:
    contact = surface_of(solver)
    others = [_bound(solver)] + ([contact.items[0].master] if contact else [])
    free = np.setdiff1d(np.arange(solver.model.node_count), np.concatenate(others))
    found = Nodes()
    found.free = wp.array(free, dtype=wp.int32)
    found.gravity = wp.vec3d(*solver.model.gravity[0])
    if (own := nodal_gravity(solver.model)) is not None:
        found.weight = wp.array(own, dtype=wp.vec3d)
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
