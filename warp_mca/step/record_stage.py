"""Owns the stages that record: sums over elements, springs and nodes, in the rings that the host reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.contact import spring
from warp_mca.kernels.records import ledger
from warp_mca.step.workspace import ROWS

if TYPE_CHECKING:
    from warp_mca.model.layout import Layout
    from warp_mca.model.model import Model
    from warp_mca.physics.contact.stage import ContactStage
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.physics.joints.constraint_stage import ConstraintStage
    from warp_mca.step.node_stage import NodeStage
    from warp_mca.step.stage import Step
    from warp_mca.step.workspace import Workspace


class RecordStage:
    """Sums of a record, of each scene apart."""

    def __init__(
        self, model: Model, layout: Layout, work: Workspace, elements: Sequence[ElementStage], precision: str
    ) -> None:
        """Allocate on the current device."""
        self.work, self.scenes = work, layout.count
        self.lanes = ledger.RUN if wp.get_device().is_cuda else 1
        self.node_first = wp.array(layout.nodes, dtype=wp.int32)
        self.element_ranges = wp.array(layout.elements, dtype=wp.int32)
        self.most_nodes = int(np.diff(layout.nodes).max())  # of any scene
        self.most_elements = int(np.diff(layout.elements).sum(axis=(1, 2)).max())
        self.sum_elements_kernel = ledger.sum_elements_kernel(precision)

    def kernels(self) -> list[Any]:
        """Those of a record."""
        return [ledger.record_motion, spring.sum_springs, self.sum_elements_kernel]

    def sum_runs(self, kernel: Any, largest: int, inputs: list[Any], *outputs: wp.array) -> None:
        """Sums of each run of entries, by a block of threads each; no scene has more entries than `largest`."""
        runs = min(max(-(-largest // ledger.RUN), 1), ledger.SUM_WIDTH)
        threads = (self.scenes, runs, self.lanes)
        wp.launch(kernel, threads, inputs=[self.work.row, *inputs], outputs=[self.work.partial, *outputs])

    def next_row(self, step: Step) -> None:
        """Next row of the rings."""
        wp.launch(ledger.advance_row, 1, inputs=[ROWS], outputs=[self.work.row])

    def sum_springs(self, step: Step, stage: ContactStage) -> None:
        """Sums of a contact pass. In a check between rows, what is summed over an output interval goes on."""
        inputs = [stage.column, stage.first, step.is_row, step.state.contacts[stage.index].spring]
        self.sum_runs(spring.sum_springs, int(np.diff(stage.springs).max()), inputs)

    def sum_elements(self, step: Step) -> None:
        """Energies and extremes of the elements."""
        self.sum_runs(self.sum_elements_kernel, self.most_elements, [self.work.energy, self.element_ranges])

    def sum_motion(self, step: Step, constraints: ConstraintStage, nodes: NodeStage) -> None:
        """Kinetic energy, works, and velocities of recorded points."""
        work, state = self.work, step.state
        u, v, dt = nodes.at_record(state)
        inputs = [work.mass, work.heavy_mass, work.gravity, u, work.v_before, v, dt, self.node_first]
        inputs += [state.constraints.work, constraints.driven_first, work.point_node]
        self.sum_runs(ledger.record_motion, self.most_nodes, inputs, work.point_velocity)
