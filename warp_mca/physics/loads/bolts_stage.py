"""Owns the device side of bolts: their springs, and the forces in their shanks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import warp as wp

from warp_mca.base.joining import offsets
from warp_mca.kernels.nodes import spring
from warp_mca.physics.loads.springs_stage import SpringsStage

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.state import State


class BoltsStage(SpringsStage):
    """All bolts."""

    def __init__(self, solver: System, name: str) -> None:
        """Allocate on the current device."""
        super().__init__(solver, name)
        self.begin = wp.array(offsets([len(item.bars) for item in self.items]), dtype=wp.int32)
        self.axial, self.shear = (wp.zeros(len(self.items), dtype=wp.float64) for _ in range(2))

    def record_kernels(self) -> list[Any]:
        """Those of a step."""
        return [*super().record_kernels(), spring.read_bolts]

    def energies_of(self, state: State) -> Sequence[wp.array]:
        """Stored, and given by what tightens them."""
        own = state.parts[self.name]
        return [own.energy, own.taken]

    def readings_of(self, state: State) -> Sequence[wp.array]:
        """Axial and shear force."""
        own = state.parts[self.name]
        inputs, outputs = [self.begin, own.pull, own.along], [self.axial, self.shear]
        wp.launch(spring.read_bolts, len(self.items), inputs=inputs, outputs=outputs)
        return outputs
