"""Owns the springs of slave nodes on the device, and the edges of slaves that rest on edges of a master."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.kernels.contact import contact, edge_shares, edges, spring, switching
from warp_mca.kernels.contact.laws import law_functions
from warp_mca.physics.contact.bonds import glue
from warp_mca.system.threads import CONTACT, Split

if TYPE_CHECKING:
    from warp_mca.physics.contact.contact_state import ContactState
    from warp_mca.physics.contact.stage import ContactStage
    from warp_mca.system.state import State
    from warp_mca.system.workspace import Workspace


def new_springs(count: int, sided: int, stage: ContactStage) -> Any:
    """Springs of a pass that nothing presses, as many as `sided` of which are of masters with several sides.

    Where some begin free of stress, their resting depth is 0.
    """
    found = spring.Spring()
    numbers = "energy friction drive normal_impulse stick_impulse depth lost made stiffness normal_energy"
    for name in ("tangential", "force", "impulse"):
        setattr(found, name, wp.zeros(count, dtype=wp.vec3d))
    for name in numbers.split():
        setattr(found, name, wp.zeros(count, dtype=wp.float64))
    found.dashpot = wp.zeros(0 if law_functions(stage.laws.normal).dashpot is None else count, dtype=wp.vec2d)
    found.parameters, found.friction_parameters = stage.parameters, stage.friction_parameters
    found.limit = wp.zeros(count if stage.laws.friction else 0, dtype=wp.float64)
    found.rest = wp.zeros(count if stage.may_rest else sided, dtype=wp.float64)
    found.pressed = wp.zeros(count if stage.laws.pressed else 0, dtype=wp.vec2d)
    found.owed = wp.array(_shares(stage), dtype=wp.vec3d)
    found.left = wp.zeros(sided, dtype=wp.float64)
    found.share = wp.full(sided, 1.0, dtype=wp.float64)
    found.support = wp.full(sided, -1, dtype=wp.int32)
    found.bears = wp.zeros(sided, dtype=wp.int32)
    found.rests = wp.zeros(len(stage.slave) if sided else 0, dtype=wp.int32)
    found.held = wp.full(count, spring.ANY_DEPTH, dtype=wp.float64)
    found.face = wp.full(count, -1, dtype=wp.int32)
    found.weight = wp.zeros(count, dtype=wp.vec4d)
    glue(found, stage)
    return found


def return_energy(stage: ContactStage, springs: Any, on: bool) -> None:
    """Let springs return energy from now on, or none while velocities change otherwise than by forces."""
    springs.owed.assign(_shares(stage) if on else 0.0 * _shares(stage))


def _shares(stage: ContactStage) -> NDArray[np.float64]:
    """`Spring.owed` at the start, shape (spring_count, 3), or (0, 3) where no spring returns energy."""
    rows = [(0.0, 0.0, switching.SHARE if item.returns else 0.0) for item in stage.items]
    found = np.repeat(rows, np.diff(stage.springs), axis=0)
    return found if stage.laws.returns else found[:0]


def faces_of_slaves(stage: ContactStage, face: NDArray[np.int32], rows: tuple[wp.array, wp.array]) -> Any:
    """`kernels.contact.edges.SlaveFaces`; `face`: shape (face_count, 4); `rows`: those around each node, compressed."""
    number = np.full(stage.node_count, -1, np.int32)
    number[np.concatenate([item.slave for item in stage.items])] = np.arange(len(stage.slave))
    found = edges.SlaveFaces()
    found.node, found.stiffness = stage.slave, stage.stiffness
    found.face, found.number = (wp.array(values, dtype=wp.int32) for values in (face, number))
    found.offset, found.face_of_slave = rows
    return found


class SlaveEdges:
    """Slave nodes with the faces around them, and the kernels that let edges of these faces rest on the master.

    Attributes:
        faces: `kernels.contact.edges.SlaveFaces`.
        carry, find: kernels of a step and of a search; see `kernels.contact.edge_shares`.
    """

    def __init__(self, stage: ContactStage) -> None:
        self.carry = edge_shares.carry_kernel(stage.sides)
        self.find = edge_shares.along_edges_kernel(stage.each, stage.sides, stage.lanes)
        self.faces = stage.slave_faces

    def list_faces(self, stage: ContactStage, work: Workspace, state: State, u: wp.array, split: Split) -> None:
        """Add to the lists of a search the faces along edges from nodes that slid off a side."""
        own = state.contacts[stage.index]
        inputs = [stage.bvh.id, stage.lower, stage.upper, work.X, u, self.faces, stage.side]
        inputs += [stage.slave_scene, stage.origin, stage.pairs_of(own), own.spring]
        lists = [own.count, own.candidate, own.face_count, own.face_slave, state.flag]

        def launch(part: slice) -> None:
            wp.launch(self.find, stage.lanes * (part.stop - part.start), [part.start, *inputs], lists)

        split(len(stage.slave), launch, CONTACT)

    def launch(self, work: Workspace, own: ContactState, split: Split) -> None:
        """Add their share of the force on each edge to the inner nodes."""

        def launch(part: slice) -> None:
            inputs = [part.start, self.faces, own.spring]
            wp.launch(self.carry, part.stop - part.start, inputs, [work.nodal_force], block_dim=contact.BLOCK_DIM)

        split(len(self.faces.node), launch, CONTACT)
