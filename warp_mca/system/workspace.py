"""Owns the model's arrays on the device, and what a step computes and forgets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.elements.failure import ENERGIES
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.floating import Frames
from warp_mca.kernels.records.columns import JACOBIAN
from warp_mca.kernels.records.ledger import RUN, SUM_WIDTH
from warp_mca.system.columns import column_count
from warp_mca.system.layout import Layout
from warp_mca.system.model import Model
from warp_mca.system.precision import limited
from warp_mca.system.weight import heavy_mass

if TYPE_CHECKING:
    from warp_mca.system.state import State

ROWS = 32  # records kept on the device before the host reads them
ALL = slice(None)


def run_count(model: Model, layout: Layout) -> int:
    """Runs that records keep of each scene: SUM_WIDTH, or fewer where the scenes of a batch are small.

    Any power of two from 8 on gives the same bits, because numpy adds as many numbers side by side.
    """
    if layout.count == 1:
        return SUM_WIDTH
    springs = max((item.sides for item in model.passes), default=0) * max(
        (len(item.slave) for item in model.passes), default=0
    )
    loaded = sum(len(item.node) for items in model.loads.values() for item in items)
    own = [np.diff(layout.nodes).max(), np.diff(layout.elements).sum(axis=(1, 2)).max()]
    most = max(springs, loaded, len(model.absorbing.node), *map(int, own))
    return min(SUM_WIDTH, max(8, 1 << (-(-most // RUN) - 1).bit_length()))


class Workspace:
    """Arrays that stages share.

    Attributes:
        X: reference positions [m], shape (node_count,), vec3d.
        mass, inverse_mass: lumped masses [kg], [1/kg], shape (node_count,), float64; slaves of ties, which have none,
            are divided by 1 kg.
        heavy_mass: those that have weight [kg], shape (node_count,), float64; `mass` itself without mass scaling.
        law: parameters of each material, see `Model.law`, in the scalars of the precision.
        first_slots, more_slots: slots of the forces on each node, see `gather_lists`.
        frame: floating frame of each node, shape (node_count,), int32; None where elements compute in the world frame.
        u_seen: displacement of each node in its frame [m], shape (node_count,), vec3d; empty without frames.
        force: of each element on its nodes in their frames, by slot [N], vec3 in the scalars of the precision.
        nodal_force: forces on nodes beside those of elements [N], of contact and loads, shape (node_count,), vec3d,
            zero between steps; empty without these.
        u_record: displacements at the latest record [m], shape (node_count,), vec3d, for energies and stresses that are
            taken while nodes move; empty on a CPU with one rate.
        v_before: velocities at the half step before a record [m/s], shape (node_count,), vec3d.
        energy: of each element at a record, see `ElementStage.energies`, shape (5 to 7, element_count).
        row: of the latest record in the rings, shape (1,), int32.
        partial: ring of partial sums, shape (ROWS, scene_count, column_count, run_count), float64.
        point_node: recorded nodes, 0 where there is none, shape (point_count,), int32.
        point_velocity: ring of their velocities [m/s], shape (ROWS, point_count), vec3d.
        gravity: of each scene [m/s^2], shape (scene_count,), vec3d.
    """

    def __init__(
        self, model: Model, layout: Layout, precision: str, first_slots: np.ndarray, more_slots: np.ndarray, slots: int
    ):
        """Allocate on the current device; `slots` are those of the forces."""
        t = scalars(precision)
        self.X = wp.array(model.X, dtype=wp.vec3d)
        self.mass = wp.array(model.mass, dtype=wp.float64)
        self.inverse_mass = wp.array(1.0 / np.where(model.mass > 0.0, model.mass, 1.0), dtype=wp.float64)
        self.heavy_mass = wp.array(heavy_mass(model), dtype=wp.float64) if model.scaling else self.mass
        self.law = wp.array(limited(model.law, precision), dtype=t.real)
        self.first_slots, self.more_slots = wp.array(first_slots, dtype=wp.vec2i), wp.array(more_slots, dtype=wp.vec4i)
        self.frame = wp.array(model.floating.frame, dtype=wp.int32) if model.floating else None
        self.u_seen = wp.zeros(model.node_count if model.floating else 0, dtype=wp.vec3d)
        # one slot more, without force, for nodes without elements
        self.force = wp.zeros(slots + bool(model.rigid_bodies), dtype=t.vec3)
        pushed = model.passes or any(len(item.node) for items in model.loads.values() for item in items)
        self.nodal_force = wp.zeros(model.node_count if pushed else 0, dtype=wp.vec3d)
        kept = wp.get_device().is_cuda or model.rates is not None
        self.u_record = wp.zeros(model.node_count if kept else 0, dtype=wp.vec3d)
        self.v_before = wp.zeros(model.node_count, dtype=wp.vec3d)
        self.energy = wp.zeros(
            (ENERGIES if model.fails else 6 if model.viscous else 5, model.element_count), dtype=t.real
        )
        self.row = wp.full(1, ROWS - 1, dtype=wp.int32)
        self.partial = wp.zeros((ROWS, layout.count, column_count(model), run_count(model, layout)), dtype=wp.float64)
        self.partial[:, :, JACOBIAN].fill_(1.0)  # runs beyond the last are never written
        self.point_node = wp.array(np.maximum(model.points, 0), dtype=wp.int32)
        self.point_velocity = wp.zeros((ROWS, len(model.points)), dtype=wp.vec3d)
        self.gravity = wp.array(model.gravity, dtype=wp.vec3d)

    def displacements(self, state: State) -> wp.array:
        """What elements compute with: displacements in the world frame or, with floating frames, in these [m]."""
        return state.u if self.frame is None else self.u_seen

    def at_record(self, state: State) -> wp.array:
        """Displacements of the step that records [m], in the world frame."""
        return self.u_record if len(self.u_record) else state.u

    def keep(self, state: State) -> None:
        """Keep the displacements of the record."""
        if len(self.u_record):
            wp.copy(self.u_record, state.u)

    def frames(self, state: State, part: slice = ALL) -> Any:
        """Frames of a range of nodes, as kernels that gather forces take them."""
        found = Frames()
        if self.frame is not None:
            found.of_node, found.rotation = self.frame[part], state.floating.rotation
        return found
