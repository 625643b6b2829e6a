"""Owns the device side of probes and sections: the ring of what they record.

The force through a section is that which elements on its upper side put on the nodes that they share with the lower
side. At each row of the history these elements, a layer of cells, are computed once more by their own kernels, from
copies of their histories: the slots of the step itself may hold sums over elements of both sides.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.arrays import Index
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.records import sensors as kernels
from warp_mca.model.sensors import CHANNELS, Cut, Sensors, Spot
from warp_mca.physics.elements import ELEMENTS
from warp_mca.physics.elements.failing import silence
from warp_mca.physics.elements.state import ElementState
from warp_mca.system.block import Block
from warp_mca.system.workspace import ROWS

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.step.solver import Solver
    from warp_mca.system.stage import Step
    from warp_mca.system.state import State


class SensorStage:
    """Probes and sections of all scenes.

    Attributes:
        spots, sections: what they record; None where there are none.
    """

    def __init__(self, solver: Solver, sensors: Sequence[Sensors]) -> None:
        """Allocate on the solver's device; `sensors` of each scene, in the numbers of the model."""
        spots: list[tuple[int, Spot]] = []
        cuts: list[tuple[int, Cut]] = []
        channel = 0
        for item in sensors:
            spots += [(channel + CHANNELS * k, spot) for k, spot in enumerate(item.spots)]
            cuts += [(channel + CHANNELS * (len(item.spots) + k), cut) for k, cut in enumerate(item.cuts)]
            channel += item.channels
        with wp.ScopedDevice(solver.device):
            self._ring = wp.zeros((ROWS, channel), dtype=wp.float64)
            self.spots = _Spots(solver, spots, self._ring) if spots else None
            self.sections = _Sections(solver, cuts, self._ring) if cuts else None

    def kernels(self) -> list[Any]:
        """Those with blocks of Warp's own number of threads."""
        return [*([kernels.mean_vectors] if self.spots else []), *(self.sections.kernels() if self.sections else [])]

    @property
    def layers(self) -> list[ElementStage]:
        """Stages of the elements beside sections."""
        return [layer.stage for layer in self.sections.layers] if self.sections else []

    def rings(self) -> dict[str, wp.array]:
        """Ring of records, where there are any, shape (ROWS, channel_count), float64.

        Of each scene position [m] and velocity [m/s] of its probes, then force [N] and moment [N m] of its sections.
        """
        return {"sensors": self._ring} if self.spots or self.sections else {}

    def before_step(self, step: Step) -> None:
        """Record places and forces at t(n), once the forces of the step are known."""
        if self.spots and step.is_row:
            self.spots.record_places(step.state)
        if self.sections and step.is_row:
            self.sections.record(step.state)

    def after_step(self, step: Step) -> None:
        """Record velocities, from those on both sides of t(n)."""
        if self.spots and step.is_row:
            self.spots.record_velocities(step.state)


class _Spots:
    """Probes: means over some nodes."""

    def __init__(self, solver: Solver, spots: Sequence[tuple[int, Spot]], ring: wp.array) -> None:
        """Allocate; `spots` come with their first channels."""
        self.work, self.ring, self.count = solver.work, ring, len(spots)
        self.lanes = kernels.LANES if wp.get_device().is_cuda else 1
        self.offset = _ints([0, *accumulate(len(spot.node) for _, spot in spots)])
        self.node = _ints(np.concatenate([spot.node for _, spot in spots]))
        self.weight = wp.array(np.concatenate([spot.weight for _, spot in spots]), dtype=wp.float64)
        self.channel = _ints([channel for channel, _ in spots])

    def record_places(self, state: State) -> None:
        """Positions X + u(n)."""
        self._record(1.0, self.work.X, state.u, 0)

    def record_velocities(self, state: State) -> None:
        """Velocities (v(n-1/2) + v(n+1/2)) / 2."""
        self._record(0.5, self.work.v_before, state.v, 3)

    def _record(self, share: float, first: wp.array, second: wp.array, place: int) -> None:
        inputs = [self.work.row, self.offset, self.node, self.weight, share, first, second, self.channel, place]
        wp.launch(kernels.mean_vectors, (self.count, self.lanes), inputs=inputs, outputs=[self.ring])


@dataclass
class _Layer:
    """Elements of a block beside a section.

    Attributes:
        block: number of the block in the model.
        element: their places in it, shape (count,), int32.
        stage: that computes them.
        own: copies of their history.
    """

    block: int
    element: wp.array
    stage: ElementStage
    own: ElementState


@dataclass
class _View:
    """What a stage of elements reads of the workspace and of the state, with forces and histories of its own.

    Attributes:
        X, law, force: as in `Workspace`.
        seen: displacements as elements see them [m].
        elements: of the only block.
    """

    X: wp.array
    law: wp.array
    force: wp.array
    seen: wp.array
    elements: list[ElementState]

    def displacements(self, state: object) -> wp.array:
        """As `Workspace.displacements`."""
        return self.seen


class _Sections:
    """Sections: resultants of the forces of the elements above them."""

    def __init__(self, solver: Solver, cuts: Sequence[tuple[int, Cut]], ring: wp.array) -> None:
        """Allocate; `cuts` come with their first channels."""
        self.work, self.ring, self.count = solver.work, ring, len(cuts)
        self.lanes = kernels.LANES if wp.get_device().is_cuda else 1
        self.layers: list[_Layer] = []
        slots: list[Index] = []  # of each cut, of forces on its nodes
        nodes: list[Index] = []
        for _, cut in cuts:
            found = list(self._layers_of(cut, solver))
            slots.append(np.concatenate([slot for slot, _ in found]))
            nodes.append(np.concatenate([node for _, node in found]))
        self.force = wp.zeros(self._slots, dtype=scalars(solver.precision).vec3)
        self.offset = _ints([0, *accumulate(len(slot) for slot in slots)])
        self.slot, self.node = _ints(np.concatenate(slots)), _ints(np.concatenate(nodes))
        self.weight = wp.array(np.concatenate([_shares(node) for node in nodes]), dtype=wp.float64)
        self.channel = _ints([channel for channel, _ in cuts])
        self.sum_kernel = kernels.resultants_kernel(solver.precision, solver.work.frame is not None)
        self.copy_kernel = kernels.history_kernel(solver.precision)

    @property
    def _slots(self) -> int:
        return sum(len(layer.stage.slot_node) for layer in self.layers)

    def _layers_of(self, cut: Cut, solver: Solver) -> Iterator[tuple[Index, Index]]:
        """Make the layers of a cut: the slots of forces on its nodes, and these nodes."""
        end = cut.first + len(cut.height)
        blocks = enumerate(solver.model.blocks)
        inside = [(k, np.flatnonzero((b.conn[0] >= cut.first) & (b.conn[0] < end))) for k, b in blocks]
        conns = [solver.model.blocks[k].conn[:, mine].T for k, mine in inside]
        above, shared = cut.interface(conns)
        for (k, mine), chosen in zip(inside, above, strict=True):
            if not chosen.any():
                continue
            block, own = solver.model.blocks[k], mine[chosen]
            element, counted = _with_neighbours(block, own)
            part = replace(block.part(element), failing=None)
            stage = ELEMENTS[block.element].stage(part, solver.model.X, solver.precision)
            stage.slot = self._slots
            self.layers.append(_Layer(k, _ints(element), stage, stage.new_state()))
            on_cut = np.isin(stage.slot_node, shared)
            if len(element) > len(own):  # slots are those of elements one by one: neighbours do not count
                on_cut &= np.tile(counted, stage.corners)
            slot = np.flatnonzero(on_cut).astype(np.int32)
            yield slot + np.int32(stage.slot), stage.slot_node[slot]

    def kernels(self) -> list[Any]:
        """As `SensorStage.kernels`."""
        return [self.sum_kernel, self.copy_kernel]

    def record(self, state: State) -> None:
        """Forces at the state's displacements, and their resultants."""
        work = self.work
        for layer in self.layers:
            source, own = state.elements[layer.block], layer.own
            if len(own.yielded):
                inputs = [layer.element, source.yielded, source.history]
                wp.launch(self.copy_kernel, own.history.shape, inputs=inputs, outputs=[own.yielded, own.history])
            if layer.stage.block.viscous:
                inputs = [layer.element, source.yielded, source.extreme]
                wp.launch(self.copy_kernel, own.extreme.shape, inputs=inputs, outputs=[own.yielded, own.extreme])
            view: Any = _View(work.X, work.law, self.force, work.displacements(state), [own])
            layer.stage.launch(view, view)
            if source.failing:
                silence(layer.stage, layer.element, source.failing, self.force)
        inputs = [work.row, self.offset, self.slot, self.node, self.weight, work.X, state.u, self.force]
        inputs += [work.frames(state), self.channel]
        wp.launch(self.sum_kernel, (self.count, self.lanes), inputs=inputs, outputs=[self.ring])


def _with_neighbours(block: Block, own: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Elements to compute for the forces of some, and which of them these are.

    Forces of some formulations depend on all elements around their nodes, `Element.one_rate`.
    """
    if not getattr(ELEMENTS[block.element], "one_rate", False):
        return own, np.ones(len(own), dtype=bool)
    around = np.flatnonzero(np.isin(block.conn, block.conn[:, own]).any(axis=0))
    return around, np.isin(around, own)


def _shares(node: Index) -> NDArray[np.float64]:
    """Weight of each entry in the mean over different nodes [-]."""
    _, inverse, repeated = np.unique(node, return_inverse=True, return_counts=True)
    return 1.0 / (repeated[inverse] * len(repeated))


def _ints(values: Any) -> wp.array:
    return wp.array(np.asarray(values, dtype=np.int32), dtype=wp.int32)
