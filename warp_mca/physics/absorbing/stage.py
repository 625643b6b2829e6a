"""Owns the stage of absorbing boundaries: their nodes move against dashpots, and what these take up is recorded."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.nodes.absorbing import Dashpots, absorbing_kernel
from warp_mca.kernels.nodes.gather import LEVEL_BIT
from warp_mca.kernels.records.absorbing import sum_absorbed
from warp_mca.physics.elements.stage import BLOCK_DIM
from warp_mca.system.actor import Actor, When
from warp_mca.system.columns import added_columns
from warp_mca.system.reading import on_host
from warp_mca.system.stage import BESIDE, Stage, Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.state import State


@dataclass(eq=False)
class AbsorbingState:
    """What absorbing boundaries have taken up; empty where a scene has none.

    Attributes:
        impulse: given by each of their nodes to what lies beyond up to t(n) [N s], shape (count,), vec3d.
        impulse_after: the same half a step later [N s], shape (count,), vec3d.
        absorbed: energy that each node gave away, in the frame of its body, up to t(n) [J], shape (count,), float64.
        absorbed_after: the same half a step later [J], shape (count,), float64.
        stretch: displacement of each node less the way of its body [m], shape (count,), vec3d; empty without springs.
    """

    impulse: wp.array
    impulse_after: wp.array
    absorbed: wp.array
    absorbed_after: wp.array
    stretch: wp.array


class AbsorbingStage(Actor):
    """What `kernels.nodes.absorbing` reads and writes.

    Attributes:
        count: nodes of absorbing boundaries.
        items, chains: of the kernel: those up to each level, and those of each.
    """

    block_dim = BLOCK_DIM

    def __init__(self, solver: System) -> None:
        """Allocate on the current device."""
        model, nodes, layout = solver.model, solver.nodes, solver.layout
        own, self.nodes, self.layout, self.records = model.absorbing, nodes, layout, solver.records
        self.count, self.model = len(own.node), model
        if not self.count:
            return
        level = model.rates.node_level[own.node].astype(np.int32) if model.rates else np.zeros(self.count, np.int32)
        step = (nodes.base * 2.0**level)[:, None, None]
        decay = 0.5 * step * own.damping / model.mass[own.node, None, None]
        item = np.arange(self.count, dtype=np.int32) + (level << LEVEL_BIT)
        levels = range(model.rates.top + 1 if model.rates else 1)
        self.items = [wp.array(item[level <= k], dtype=wp.int32) for k in levels]
        self.chains = [wp.array(item[level == k], dtype=wp.int32) for k in levels]
        self.dashpots = Dashpots()
        self.dashpots.node = wp.array(own.node, dtype=wp.int32)
        self.dashpots.damping = wp.array(own.damping, dtype=wp.mat33d)
        stiffness = own.stiffness if own.sprung else own.stiffness[:0]
        self.dashpots.stiffness = wp.array(stiffness, dtype=wp.mat33d)
        self.dashpots.share = wp.array(np.linalg.inv(np.eye(3) + decay), dtype=wp.mat33d)
        self.dashpots.velocity = wp.array(own.velocity, dtype=wp.vec3d)
        self.kernel = absorbing_kernel(nodes.kind, own.sprung)
        first = np.searchsorted(own.node, layout.nodes)
        self.first, self.most = wp.array(first, dtype=wp.int32), int(np.diff(first).max())
        self.column = added_columns(model)["absorbing"].first

    def new_state(self) -> AbsorbingState:
        """State before the first step, on the current device."""
        return AbsorbingState(
            impulse=wp.zeros(self.count, dtype=wp.vec3d),
            impulse_after=wp.zeros(self.count, dtype=wp.vec3d),
            absorbed=wp.zeros(self.count, dtype=wp.float64),
            absorbed_after=wp.zeros(self.count, dtype=wp.float64),
            stretch=wp.zeros(self.count if self.model.absorbing.sprung else 0, dtype=wp.vec3d),
        )

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.kernel] if self.count else []

    def record_kernels(self) -> list[Any]:
        """Those of a record."""
        return [sum_absorbed] if self.count else []

    def stages(self, when: When) -> Iterable[Stage]:
        """Its nodes, against their dashpots; energy absorbed and work of what lies beyond."""
        if self.count and len(item := self._items(when)):
            yield Stage("advance", "absorbing boundaries", lambda s: self._advance(s, item, when.level), BESIDE)
        if self.count:
            yield Stage("works", "absorbed energy", self._sum, only_records=True)

    def _items(self, when: When) -> wp.array:
        """Its nodes up to a level, or all; of one level where a chain is given. As the kernel takes them."""
        if when.chain is not None:
            return self.chains[when.chain]
        return self.items[-1 if when.level is None else when.level]

    def _advance(self, step: Step, item: wp.array, level: int | None) -> None:
        """Some of its nodes, with forces of elements up to a level, or of all."""
        nodes, own = self.nodes, step.state.absorbing
        inputs = [item, self.dashpots, *nodes.given(step.state, level), nodes.scene, nodes.gravity, nodes.base]
        outputs = [nodes.moved(step.state, step.records)]
        outputs += [own.impulse, own.impulse_after, own.absorbed, own.absorbed_after, own.stretch]
        wp.launch(self.kernel, len(item), inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)

    def _sum(self, step: Step) -> None:
        """Energy absorbed and work of what lies beyond, in the record."""
        own = step.state.absorbing
        inputs = [self.column, self.first, self.dashpots.velocity, own.impulse, own.absorbed]
        self.records.sum_runs(sum_absorbed, self.most, inputs)

    def impulses(self, state: State, scene: int = 0) -> dict[str, list[float]]:
        """Impulse that each body of a scene gave to what lies beyond its absorbing boundaries [N s], by name."""
        names = [name for name in self.model.node_start if self.layout.count == 1 or name.startswith(f"{scene}/")]
        starts = [self.model.node_start[name] for name in names]
        bounds = np.searchsorted(self.model.absorbing.node, [*starts, self.layout.nodes[scene + 1]])
        impulse = on_host(state.absorbing.impulse)
        spans = zip(names, bounds[:-1], bounds[1:], strict=True)
        own = {name: impulse[first:end].sum(axis=0).tolist() for name, first, end in spans if end > first}
        return own if self.layout.count == 1 else {name.split("/", 1)[1]: value for name, value in own.items()}
