"""Owns the stages of floating frames: they follow their bodies at records, and nodes are seen in them in every step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.elements.stage import BLOCK_DIM
from warp_mca.kernels.nodes import floating
from warp_mca.solve.threads import NODES

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.solve.stage import Step
    from warp_mca.solve.workspace import Workspace


@dataclass(eq=False)
class FloatingState:
    """State of floating frames; empty where elements compute in the world frame.

    Attributes:
        rotation: of each frame since the start of the phase, a unit quaternion [-], shape (frame_count,), quatd.
    """

    rotation: wp.array


class FloatingStage:
    """What `kernels.nodes.floating` reads and writes.

    Attributes:
        count: frames.
    """

    def __init__(self, model: Model, work: Workspace) -> None:
        """Allocate on the current device."""
        marker = model.floating.marker if model.floating else np.zeros((0, 4), np.int32)
        self.work, self.count, self.node_count = work, len(marker), model.node_count
        self.marker = wp.array(marker, dtype=wp.int32)
        self.see_kernel = floating.see_kernel(False)
        rates = model.rates if self.count else None
        levels = [np.flatnonzero(rates.node_level <= k) for k in range(rates.top)] if rates else []
        self.active = [wp.array(nodes, dtype=wp.int32) for nodes in levels]
        self.see_active_kernel = floating.see_kernel(True)

    def new_state(self) -> FloatingState:
        """Frames that have not turned, on the current device."""
        return FloatingState(rotation=wp.array([(0.0, 0.0, 0.0, 1.0)] * self.count, dtype=wp.quatd))

    def kernels(self) -> list[Any]:
        """Those of a step."""
        if not self.count:
            return []
        return [floating.follow_bodies, self.see_kernel, *([self.see_active_kernel] if self.active else [])]

    def follow(self, step: Step) -> None:
        """Turn the frames with their bodies."""
        outputs = [step.state.floating.rotation]
        wp.launch(floating.follow_bodies, self.count, inputs=[self.work.X, self.marker, step.state.u], outputs=outputs)

    def see(self, step: Step, level: int | None = None) -> None:
        """Displacements in their frames of the nodes up to a `level` of `Model.rates`, or of all."""
        work, state = self.work, step.state
        active = None if level is None else self.active[level]

        def launch(part: slice) -> None:
            if active is None:
                kernel, arrays = self.see_kernel, [None, work.X[part], work.frames(state, part), state.u[part]]
                seen = work.u_seen[part]
            else:
                kernel, arrays = self.see_active_kernel, [active[part], work.X, work.frames(state), state.u]
                seen = work.u_seen
            wp.launch(kernel, part.stop - part.start, inputs=arrays, outputs=[seen], block_dim=BLOCK_DIM)

        step.split(self.node_count if active is None else len(active), launch, NODES)
