"""Owns the device side of bolts: their springs, what tightens them, and the forces in their shanks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.base.joining import offsets
from warp_mca.kernels.nodes import bolt
from warp_mca.physics.loads.springs_stage import BLOCK, SpringsStage, SpringsState
from warp_mca.system.stage import Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.state import State


@dataclass(eq=False)
class BoltsState(SpringsState):
    """State of bolts: that of their springs, and of what tightens them.

    Attributes:
        length: L_0 of each spring [m], shape (count,), float64.
        preload: of each [N], shape (count,), float64.
        turned: time for which each bolt has been tightened [s], shape (bolt_count,), float64.
        work: of what tightens it up to t(n) [J], shape (count,), float64.
    """

    length: wp.array
    preload: wp.array
    turned: wp.array
    work: wp.array


class BoltsStage(SpringsStage):
    """All bolts."""

    def __init__(self, solver: System, name: str) -> None:
        """Allocate on the current device."""
        super().__init__(solver, name)
        bolts, own = self.items, bolt.Shanks()
        self.axial, self.shear = (wp.zeros(len(bolts), dtype=wp.float64) for _ in range(2))
        self.L = wp.zeros(self.count, dtype=wp.float64)
        own.begin = wp.array(offsets([len(item.bars) for item in bolts]), dtype=wp.int32)
        own.length, own.preload = self.length, self.preload
        own.slanted = wp.array(np.concatenate([item.slanted for item in bolts]), dtype=wp.int32)
        own.rise = wp.array([item.rise for item in bolts], dtype=wp.float64)
        own.tightens = wp.zeros(1, dtype=wp.int32)
        self.shanks = own

    def settle(self, on: bool) -> float:
        """Bolts are tightened from now on, or no more; the longest rise of their preloads [s]."""
        self.shanks.tightens.fill_(int(on))
        return max(item.rise for item in self.items)

    def new_state(self) -> BoltsState:
        """State before the first step, on the current device."""
        springs = super().new_state()
        own = {field.name: getattr(springs, field.name) for field in fields(springs)}
        preload, work = (wp.zeros(self.count, dtype=wp.float64) for _ in range(2))
        turned = wp.zeros(len(self.items), dtype=wp.float64)
        return BoltsState(**own, length=wp.clone(self.length), preload=preload, turned=turned, work=work)

    def record_kernels(self) -> list[Any]:
        """Those of a step, which have blocks of Warp's own size."""
        return [*super().record_kernels(), bolt.stretch_bolts, bolt.tighten_bolts, bolt.read_bolts]

    def push(self, step: Step, start: bool = False) -> None:
        """Add the forces of all bolts, which may be tightened."""
        state, kept = step.state.parts[self.name], bolt.ShankState()
        for key in ("length", "preload", "turned", "work"):
            setattr(kept, key, getattr(state, key))
        motion = self.motion(step.state)
        inputs = [self.springs, self.shanks.tightens, motion[0]]
        wp.launch(bolt.stretch_bolts, (self.count, self.lanes), inputs=inputs, outputs=[self.L], block_dim=BLOCK)
        inputs = [self.springs, self.shanks, state.elongation, self.L, 0.0 if start else self.dt]
        wp.launch(bolt.tighten_bolts, len(self.items), inputs=inputs, outputs=[kept])
        self.pull(step, start, state.length, state.preload, motion)

    def energies_of(self, state: State) -> Sequence[wp.array]:
        """Stored, and given by what tightens them."""
        own = state.parts[self.name]
        return [own.energy, own.work]

    def readings_of(self, state: State) -> Sequence[wp.array]:
        """Axial and shear force."""
        inputs = [self.shanks.begin, self.springs, state.parts[self.name].tension, self.motion(state)[0]]
        outputs = [self.axial, self.shear]
        threads = (len(self.items), self.lanes)
        wp.launch(bolt.read_bolts, threads, inputs=inputs, outputs=outputs, block_dim=BLOCK)
        return outputs
