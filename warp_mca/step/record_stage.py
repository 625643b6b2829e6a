"""Owns the stages that record: sums over elements, springs and nodes, in the rings that the host reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.elements.failure import sum_failed_kernel
from warp_mca.kernels.records import ledger, output
from warp_mca.system.actor import Actor, When
from warp_mca.system.columns import FAILURE, added_columns
from warp_mca.system.stage import BESIDE, LAST, MAIN, SHOWN, Stage, Step
from warp_mca.system.workspace import ROWS

if TYPE_CHECKING:
    from warp_mca.step.output import Output
    from warp_mca.step.solver import Solver


class RecordStage(Actor):
    """Sums of a record, of each scene apart, and what recorders show."""

    def __init__(self, solver: Solver) -> None:
        """Allocate on the current device."""
        layout = solver.layout
        self.solver, self.work, self.scenes = solver, solver.work, layout.count
        self.lanes = ledger.RUN if wp.get_device().is_cuda else 1
        self.node_first = wp.array(layout.nodes, dtype=wp.int32)
        self.element_ranges = wp.array(layout.elements, dtype=wp.int32)
        self.most_nodes = int(np.diff(layout.nodes).max())  # of any scene
        self.most_elements = int(np.diff(layout.elements).sum(axis=(1, 2)).max())
        self.failure = added_columns(solver.model).get(FAILURE)
        self.sum_failed_kernel = sum_failed_kernel(solver.precision) if self.failure else None
        self.sum_elements_kernel = ledger.sum_elements_kernel(solver.precision, solver.model.viscous)

    def record_kernels(self) -> list[Any]:
        """Those of sums, and of probes, sections and stresses that recorders show."""
        shown = self.solver.output and self.solver.output.arrays
        own = [ledger.record_motion, self.sum_elements_kernel, *([output.nodal_stress] if shown else [])]
        own += [self.sum_failed_kernel] if self.sum_failed_kernel else []
        return own + self.solver.sensors.kernels()

    def stages(self, when: When) -> Iterable[Stage]:
        """What is kept, shown and summed of each record.

        Sums over nodes may go on beside later steps where nodes have kept all that they read.
        """
        kept = self.solver.nodes.rated and not self.solver.constraints.driven
        stress = self._shown(lambda output, s: output.before_step(s.state, s.needs))
        contact = self._shown(lambda output, s: output.contact_points(s.state, s.needs))
        picture = self._shown(lambda output, s: output.nodal_stress(s.needs))
        velocity = self._shown(lambda output, s: output.after_step(s.state, s.needs))
        for place, name, launch, stream, after in (
            ("keep", "next record", self.next_row, BESIDE, ()),
            ("keep", "displacements kept", lambda s: self.work.keep(s.state), BESIDE, ()),
            ("energies", "paths, frames: stress", stress, SHOWN, ()),
            ("energies", "places, sections", lambda s: self.solver.sensors.before_step(s), BESIDE, ()),
            ("look", "frames: contact", contact, MAIN, ()),
            ("picture", "paths, frames: nodal stress", picture, LAST, (SHOWN,)),
            ("motion", "motion sums", self.sum_motion, LAST if kept else MAIN, ()),
            ("motion", "frames: velocity", velocity, MAIN, ()),
            ("motion", "velocities of probes", lambda s: self.solver.sensors.after_step(s), MAIN, ()),
        ):
            yield Stage(place, name, launch, stream, only_records=True, after=after)

    def _shown(self, show: Callable[[Output, Step], None]) -> Callable[[Step], None]:
        """Let the output show something in rows of the history, where there is one."""

        def launch(step: Step) -> None:
            if self.solver.output and step.is_row:
                show(self.solver.output, step)

        return launch

    def sum_runs(self, kernel: Any, largest: int, inputs: list[Any], *outputs: wp.array) -> None:
        """Sums of each run of entries, by a block of threads each; no scene has more entries than `largest`."""
        runs = min(max(-(-largest // ledger.RUN), 1), ledger.SUM_WIDTH)
        assert runs <= self.work.partial.shape[3]
        threads = (self.scenes, runs, self.lanes)
        wp.launch(kernel, threads, inputs=[self.work.row, *inputs], outputs=[self.work.partial, *outputs])

    def next_row(self, step: Step) -> None:
        """Next row of the rings."""
        wp.launch(ledger.advance_row, 1, inputs=[ROWS], outputs=[self.work.row])

    def sum_elements(self, step: Step) -> None:
        """Energies and extremes of the elements."""
        self.sum_runs(self.sum_elements_kernel, self.most_elements, [self.work.energy, self.element_ranges])

    def sum_failed(self, step: Step) -> None:
        """Energy that went with elements that failed."""
        assert self.failure is not None
        inputs = [self.work.energy, self.element_ranges, self.failure.first]
        self.sum_runs(self.sum_failed_kernel, self.most_elements, inputs)

    def sum_motion(self, step: Step) -> None:
        """Kinetic energy, works, and velocities of recorded points."""
        work, state = self.work, step.state
        u, v, dt = self.solver.nodes.at_record(state)
        inputs = [work.mass, work.heavy_mass, work.gravity, u, work.v_before, v, dt, self.node_first]
        inputs += [state.constraints.work, self.solver.constraints.driven_first, work.point_node]
        self.sum_runs(ledger.record_motion, self.most_nodes, inputs, work.point_velocity)
