"""Owns the device side of couplings, joints between clusters of nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.nodes import cluster

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.solve.constraint_stage import ConstraintStage
    from warp_mca.solve.load_stage import LoadStage
    from warp_mca.solve.stage import Step
    from warp_mca.solve.workspace import Workspace

BLOCK = 256  # threads of a GPU for a coupling


@dataclass(eq=False)
class CouplingState:
    """State of couplings; empty where a scene has none.

    Attributes:
        place: of each joint at t(n) [m], shape (coupling_count,), vec3d.
        orientation: rotation of the first and the second cluster since the start of the phase [-], shape
            (coupling_count, 2), quatd.
    """

    place: wp.array
    orientation: wp.array


class CouplingStage:
    """What `kernels.nodes.cluster` reads and writes.

    Attributes:
        count: number of couplings.
    """

    def __init__(
        self, model: Model, work: Workspace, constraints: ConstraintStage, loads: LoadStage, dt: float
    ) -> None:
        """Allocate on the current device."""
        self.items, self.count = model.couplings, len(model.couplings)
        self.work, self.loads, self.dt = work, loads, dt
        self.lanes = BLOCK if wp.get_device().is_cuda else 1
        if not self.count:
            return
        weight = np.zeros(len(model.joint_first))
        for item in self.items:
            weight[item.start : item.end] = item.weight
        self.clusters = cluster.Clusters()
        self.clusters.begin = wp.array([(item.start, item.middle, item.end) for item in self.items], dtype=wp.vec3i)
        self.clusters.node = constraints.bonds.first
        self.clusters.weight = wp.array(weight, dtype=wp.float64)
        base = np.full(self.count, -1)
        for k, item in enumerate(model.bases):
            base[item.coupling] = k if item.coupling >= 0 else base[item.coupling]
        self.clusters.base = wp.array(base if (base >= 0).any() else base[:0], dtype=wp.int32)
        self.clusters.axis = wp.array([item.axis for item in self.items], dtype=wp.vec3d)
        self.clusters.arm = wp.array(np.array([item.arm for item in self.items]), dtype=wp.vec3d)

    def new_state(self) -> CouplingState:
        """State before the first step, on the current device."""
        at_rest = np.zeros((self.count, 2, 4))
        at_rest[..., 3] = 1.0
        return CouplingState(
            place=wp.array([item.place for item in self.items], dtype=wp.vec3d),
            orientation=wp.array(at_rest, dtype=wp.quatd),
        )

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [cluster.couple] if self.count else []

    def couple(self, step: Step) -> None:
        """Join the clusters, once all their nodes have moved as free ones."""
        state, own = step.state, step.state.couplings
        inputs = [self.clusters, self.loads.device_bases, self.work.X, self.work.mass]
        inputs += [state.loads.carriage, state.loads.base_clock, self.dt]
        outputs = [state.u, state.v, state.speed_square, state.constraints.impulse, own.place, own.orientation]
        outputs.append(self.loads.latest)
        wp.launch(cluster.couple, (self.count, self.lanes), inputs=inputs, outputs=outputs, block_dim=BLOCK)
