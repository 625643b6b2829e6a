"""Owns thermal strains on the host and on the device; the force kernels of elements read them as a pressure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.joining import AS_IS, joinable, offsets
from warp_mca.kernels.loads.thermal import Heated, Kept, heat_kernel, work_kernel
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.physics.loads.nodal_stage import NodalLoad
from warp_mca.physics.loads.pushed import TimedNodes, tables_of
from warp_mca.scene.loads import ThermalStrain
from warp_mca.system.actor import When
from warp_mca.system.block import Block
from warp_mca.system.bodies import Bodies
from warp_mca.system.stage import Stage as StepStage
from warp_mca.system.stage import Step

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.system.actor import System
    from warp_mca.system.state import State


@joinable
@dataclass(frozen=True, kw_only=True)
class HeatedBody(TimedNodes):
    """A thermal strain; `Block.thermal` says which elements have it. It acts on no nodes.

    Attributes:
        strain: at factor 1 [-].
    """

    strain: float = field(metadata=AS_IS)
    on_nodes = False


def build(load: ThermalStrain, assembly: Bodies) -> HeatedBody:
    """Arrays of a load.

    Raises:
        RequestError: another one acts on the same body, or the law of its material gives the whole stress.
    """
    same = [item for item in assembly.scene.loads if isinstance(item, ThermalStrain) and item.body == load.body]
    if len(same) > 1:
        raise bad_value("ThermalStrain.body", load.body, "it has two thermal strains; give their sum as one")
    first = assembly.element_start[load.body]
    own = assembly.material[first : first + assembly.meshes[load.body].cell_count]
    for material in (assembly.materials[m] for m in np.unique(own)):
        functions = law_functions(material.law, "mixed")
        if material.law and not (functions.return_map or functions.rated):
            remedy = f"its material {type(material).__name__} takes no thermal strain; take Elastic or a metal"
            raise bad_value("ThermalStrain.body", load.body, remedy)
        if material.failure is not None:
            raise bad_value("ThermalStrain.body", load.body, "its elements may fail; leave failure or the strain out")
    times, values = (np.array(column) for column in (load.table.times, load.table.values))
    return HeatedBody(node=np.zeros(0, np.int32), times=times, values=values, strain=load.expansion * load.temperature)


def _heated(block: Block) -> tuple[Index, Index, Array] | None:
    """Heated elements of a block, the thermal strain of each and its volume [m^3]; None where there is none."""
    if block.thermal is None:
        return None
    own = np.flatnonzero(block.thermal[0] >= 0.0).astype(np.int32)
    return own, block.thermal[0, own].astype(np.int32), block.thermal[1, own]


class Stage(NodalLoad):
    """Device side of thermal strains: their elements, block by block."""

    def __init__(self, solver: System, name: str) -> None:
        """Allocate on the current device."""
        model = solver.model
        items: Any = model.loads[name]
        parts = [own for block in model.blocks if (own := _heated(block)) is not None]
        scene = np.array([item.scene for item in items])[np.concatenate([load for _, load, _ in parts])]
        self._counts = np.bincount(scene, minlength=solver.layout.count).astype(np.int32)
        place = np.empty(len(scene), dtype=np.int32)
        place[np.argsort(scene, kind="stable")] = np.arange(len(scene), dtype=np.int32)
        super().__init__(solver, name)
        self.tables, self.entry = tables_of(items), wp.zeros(self.count, dtype=wp.float64)
        strain = wp.array([item.strain for item in items], dtype=wp.float64)
        stages = [stage for stage in solver.elements if stage.block.heated]
        ends = offsets([len(own) for own, _, _ in parts])
        self.parts: list[tuple[ElementStage, Any]] = []
        for k, (stage, (own, load, volume)) in enumerate(zip(stages, parts, strict=True)):
            found = Heated()
            found.element = wp.array(own, dtype=wp.int32)
            found.load = wp.array(load, dtype=wp.int32)
            found.place = wp.array(place[ends[k] : ends[k + 1]], dtype=wp.int32)
            found.volume = wp.array(volume, dtype=wp.float64)
            found.strain = strain
            self.parts.append((stage, found))

    def counts(self) -> NDArray[np.int32]:
        """Heated elements of each scene."""
        return self._counts

    def new_state(self) -> Any:
        """State before the first step, on the current device: a `kernels.loads.thermal.Kept`."""
        found = Kept()
        for name in ("strain", "before", "stress", "work"):
            setattr(found, name, wp.zeros(self.count, dtype=wp.float64))
        found.clock = wp.zeros(self.count, dtype=wp.int32)
        return found

    def _kind(self, element: ElementStage) -> tuple[str, bool]:
        return self.solver.precision, element.block.finite

    def record_kernels(self) -> list[Any]:
        """Those of a step and of a record."""
        makers = (heat_kernel, work_kernel)
        return [*super().record_kernels(), *(make(*self._kind(own)) for make in makers for own, _ in self.parts)]

    def stages(self, when: When) -> Iterable[StepStage]:
        """The strains at t(n), before elements compute their forces; work of each scene."""
        yield StepStage("frames", "thermal strains", self.push)
        yield StepStage("works", f"energies: {self.name}", self._sum, only_records=True)

    def start_forces(self, state: State) -> None:
        """Forces of strains that there are at t = 0 already, at no displacement."""
        self.push(Step(state), start=True)
        for own, _ in self.parts:
            own.dt, dt = 0.0, own.dt
            own.launch(self.work, state)
            own.dt = dt

    def push(self, step: Step, start: bool = False) -> None:
        """Strains at t(n), in the extremes of elements."""
        state, kept = step.state, step.state.parts[self.name]
        for own, heated in self.parts:
            inputs = [heated, self.tables, own.material, self.work.law, self.solver.dt, start]
            outputs = [state.elements[own.index].extreme, kept.strain, kept.before, kept.stress, kept.work, kept.clock]
            wp.launch(heat_kernel(*self._kind(own)), len(heated.element), inputs=inputs, outputs=outputs)

    def energies_of(self, state: State) -> list[wp.array]:
        """Work up to t(n), once forces are known there."""
        for element, heated in self.parts:
            inputs = [
                heated,
                state.parts[self.name],
                element.material,
                self.work.law,
                state.elements[element.index].extreme,
            ]
            wp.launch(work_kernel(*self._kind(element)), len(heated.element), inputs=inputs, outputs=[self.entry])
        return [self.entry]
