"""Owns the stages of floating frames: they follow their bodies at records, and nodes are seen in them in every step."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.nodes import floating
from warp_mca.physics.elements.stage import BLOCK_DIM
from warp_mca.system.actor import Actor, When
from warp_mca.system.stage import Stage, Step
from warp_mca.system.threads import NODES

if TYPE_CHECKING:
    from warp_mca.system.actor import System


@dataclass(eq=False)
class FloatingState:
    """State of floating frames; empty where elements compute in the world frame.

    Attributes:
        rotation: of each frame since the start of the phase, a unit quaternion [-], shape (frame_count,), quatd.
    """

    rotation: wp.array


class FloatingStage(Actor):
    """What `kernels.nodes.floating` reads and writes.

    Attributes:
        count: frames.
    """

    block_dim = BLOCK_DIM

    def __init__(self, solver: System) -> None:
        """Allocate on the current device."""
        model, work = solver.model, solver.work
        marker = model.floating.marker if model.floating else np.zeros((0, 4), np.int32)
        self.work, self.count, self.node_count = work, len(marker), model.node_count
        self.marker = wp.array(marker, dtype=wp.int32)

    def new_state(self) -> FloatingState:
        """Frames that have not turned, on the current device."""
        return FloatingState(rotation=wp.array([(0.0, 0.0, 0.0, 1.0)] * self.count, dtype=wp.quatd))

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [floating.follow_bodies, floating.see_nodes] if self.count else []

    def stages(self, when: When) -> Iterable[Stage]:
        """Frames that turn with their bodies, and nodes as seen in them."""
        if self.count:
            yield Stage("frames", "floating frames", self._turn, only_records=True)
            yield Stage("frames", "nodes in floating frames", self._see)

    def _turn(self, step: Step) -> None:
        """Turn the frames with their bodies."""
        outputs = [step.state.floating.rotation]
        wp.launch(floating.follow_bodies, self.count, inputs=[self.work.X, self.marker, step.state.u], outputs=outputs)

    def _see(self, step: Step) -> None:
        """Displacements of all nodes in their frames."""
        work, state = self.work, step.state

        def launch(part: slice) -> None:
            inputs = [work.X[part], work.frames(state, part), state.u[part]]
            threads, outputs = part.stop - part.start, [work.u_seen[part]]
            wp.launch(floating.see_nodes, threads, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)

        step.split(self.node_count, launch, NODES)
