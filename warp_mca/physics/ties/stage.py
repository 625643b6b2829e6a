"""Owns the stages of tied surfaces: their masters, which carry the slaves, and the slaves, which follow them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.nodes import tied
from warp_mca.physics.elements.stage import BLOCK_DIM
from warp_mca.system.actor import Actor, When
from warp_mca.system.stage import BESIDE, Stage, Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System


class TieStage(Actor):
    """Advances the nodes of ties, which free and bound nodes leave out.

    Attributes:
        count: slaves.
    """

    block_dim = BLOCK_DIM

    def __init__(self, solver: System) -> None:
        """Allocate on the current device."""
        model, nodes = solver.model, solver.nodes
        self.nodes, self.count = nodes, len(model.ties)
        if not self.count:
            return
        ties, self.lanes = model.ties, tied.LANES if wp.get_device().is_cuda else 1
        self.masters_kernel = tied.masters_kernel(nodes.kind, self.lanes)
        self.follow_kernel = tied.follow_kernel(nodes.kind.pushed)
        entry, corner = np.nonzero(ties.weight)
        master = ties.master[entry, corner]
        order = np.argsort(master, kind="stable")
        carriers, first = np.unique(master[order], return_index=True)
        self.tied = tied.Tied()
        self.tied.slave, self.tied.master = wp.array(ties.slave, dtype=wp.int32), wp.array(carriers, dtype=wp.int32)
        self.tied.corner, self.tied.weight = (
            wp.array(ties.master, dtype=wp.vec4i),
            wp.array(ties.weight, dtype=wp.vec4d),
        )
        self.tied.first = wp.array(np.append(first, len(order)), dtype=wp.int32)
        self.tied.carried = wp.array(ties.slave[entry[order]], dtype=wp.int32)
        self.tied.share = wp.array(ties.weight[entry, corner][order], dtype=wp.float64)

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.masters_kernel, self.follow_kernel] if self.count else []

    def stages(self, when: When) -> Iterable[Stage]:
        """Masters, which carry the slaves, and slaves, once these have moved."""
        if when.common and self.count:
            yield Stage("advance", "masters of ties", lambda s: self._advance(s, when.level), BESIDE)
            yield Stage("follow", "slaves of ties", self._follow)

    def _advance(self, step: Step, level: int | None) -> None:
        """Masters, with the forces on their slaves of elements up to a level, or of all."""
        nodes, threads = self.nodes, self.lanes * len(self.tied.master)
        inputs = [*nodes.given(step.state, level), nodes.scene, nodes.gravity, self.tied, nodes.dt]
        outputs = [nodes.moved(step.state, step.records)]
        wp.launch(self.masters_kernel, threads, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)

    def _follow(self, step: Step) -> None:
        """Slaves, once their masters have moved."""
        outputs = [self.nodes.moved(step.state, step.records)]
        wp.launch(self.follow_kernel, self.count, inputs=[self.tied], outputs=outputs, block_dim=BLOCK_DIM)
