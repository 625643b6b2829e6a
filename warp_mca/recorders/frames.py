"""Owns the way of frames from the device to the recorders, which the solver never waits for.

Copies go to pinned memory behind the step that made them, and recorders work on one frame while the device computes
the next: on a GPU the host waits only when both buffers are full.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.kernels.output import OPEN, STICK
from warp_mca.recorders.recorder import CONTACT, PATHS, SURFACE, VOLUME, Frame, Recorder, RunInfo, SurfaceMesh, Volume

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.model import Model
    from warp_mca.output import Output

SLOTS = 2  # frames under way on a GPU: one that is copied, one that recorders work on


def skins(model: Model, meshes: Mapping[str, Mesh]) -> dict[str, SurfaceMesh]:
    """The skin of each body in the model's numbering."""
    found = {}
    for body, mesh in meshes.items():
        quads, _ = mesh.boundary
        nodes = np.unique(quads)
        local = np.searchsorted(nodes, quads).astype(np.int32)
        found[body] = SurfaceMesh((nodes + model.node_start[body]).astype(np.int32), local)
    return found


@dataclass
class _Slot:
    """Host copies of a frame, and when they are complete."""

    arrays: dict[str, dict[str, wp.array]]
    event: wp.Event | None
    row: int = 0


class Recording:
    """The recorders of one run."""

    def __init__(
        self, recorders: Sequence[Recorder], info: RunInfo, intervals: int, steps: int, output: Output | None
    ) -> None:
        """Start the recorders of a run of `intervals` output intervals of `steps` steps each.

        Raises:
            RequestError: one cannot be opened; those before it are closed again.
        """
        self.info, self.steps, self.output = info, steps, output
        self.rows: list[tuple[Recorder, NDArray[np.bool_]]] = []
        self.taken: dict[int, int] = {}
        self.slots: list[_Slot] = []
        self.pending: deque[_Slot] = deque()
        try:
            for recorder in recorders:
                recorder.start(info)
                self.rows.append((recorder, recorder.cadence.rows(intervals, info.output_interval)))
        except BaseException:
            self.finish(False)
            raise
        if output and self.rows:
            self._allocate(output)

    def _allocate(self, output: Output) -> None:
        """Make the host's copies of what frames hold, pinned where there is a GPU."""
        device = wp.get_device(output.solver.device)
        for _ in range(SLOTS):
            arrays = {
                need: {name: wp.empty_like(a, device="cpu", pinned=device.is_cuda) for name, a in group.items()}
                for need, group in output.arrays.items()
            }
            self.slots.append(_Slot(arrays, wp.Event(device) if device.is_cuda else None))

    def needs(self, row: int) -> frozenset[str]:
        """What a frame at the end of interval `row` must hold; empty when none is due."""
        return frozenset().union(*(recorder.needs for recorder, rows in self.rows if rows[row]))

    def take(self, row: int, needs: frozenset[str]) -> None:
        """Copy the frame that the step launched last has reduced, and pass on those that have arrived."""
        if needs and self.output:
            if not self.slots:
                self._deliver()
            slot = self.slots.pop()
            slot.row = row
            for need in needs & slot.arrays.keys():
                for name, to in slot.arrays[need].items():
                    wp.copy(to, self.output.arrays[need][name])
            if slot.event:
                wp.get_stream(slot.event.device).record_event(slot.event)
            self.pending.append(slot)
        while self.pending and (self.pending[0].event is None or self.pending[0].event.is_complete):
            self._deliver()

    def history(self, make: Callable[[], Mapping[str, NDArray[np.float64]]]) -> None:
        """Pass on further rows of the history, which are made only if someone takes them."""
        rows = make() if self.rows else {}
        for recorder, _ in list(self.rows):
            self._call(recorder, lambda recorder=recorder: recorder.history(rows))

    def finish(self, ok: bool) -> None:
        """Pass on what is under way, and close the recorders."""
        while ok and self.pending:
            self._deliver()
        for recorder, _ in list(self.rows):
            self._call(recorder, lambda recorder=recorder: recorder.finish(ok))
        self.rows = []

    def _deliver(self) -> None:
        slot = self.pending.popleft()
        if slot.event:
            wp.synchronize_event(slot.event)
        for recorder, rows in list(self.rows):
            if rows[slot.row]:
                index = self.taken.get(id(recorder), 0)
                self.taken[id(recorder)] = index + 1
                frame = self._frame(slot, recorder.needs, index)
                self._call(recorder, lambda recorder=recorder, frame=frame: recorder.frame(frame))
        self.slots.append(slot)

    def _call(self, recorder: Recorder, act: Callable[[], None]) -> None:
        """Let a recorder act; one that fails is closed and left out from then on."""
        try:
            act()
        except Exception as error:
            count = self.taken.get(id(recorder), 0)
            reason = " ".join(str(error).split()) or type(error).__name__
            self.info.warn(f"{recorder.name}: recording stopped at frame {count}: {reason}")
            self.rows = [item for item in self.rows if item[0] is not recorder]
            with suppress(Exception):
                recorder.finish(False)

    def _frame(self, slot: _Slot, needs: frozenset[str], index: int) -> Frame:
        arrays: dict[str, dict[str, Any]] = {
            need: {name: np.asarray(array.numpy()) for name, array in slot.arrays[need].items()}
            for need in needs & slot.arrays.keys()
        }
        skin: dict[str, Any] = {name: self._by_body(array) for name, array in arrays.get(SURFACE, {}).items()}
        nothing = {"points": np.zeros((0, 3), np.float32), "state": np.zeros(0, np.int32)}
        contact: dict[str, Any] = arrays.get(CONTACT, nothing)
        closed = contact["state"] != OPEN
        return Frame(
            index=index,
            step=slot.row * self.steps,
            time=slot.row * self.info.output_interval,
            points=skin.get("points", {}),
            von_mises=skin.get("von_mises", {}),
            plastic_strain=skin.get("plastic_strain", {}),
            contact_points=contact["points"][closed],
            contact_stick=contact["state"][closed] == STICK,
            path_stress=self._by_path(arrays[PATHS]["von_mises"]) if PATHS in arrays else {},
            volume=Volume(**arrays[VOLUME]) if VOLUME in arrays else None,
        )

    def _by_body(self, array: NDArray) -> dict[str, NDArray]:
        ends = np.cumsum([len(skin.nodes) for skin in self.info.surfaces.values()])
        return dict(zip(self.info.surfaces, np.split(array, ends[:-1]), strict=True))

    def _by_path(self, array: NDArray) -> dict[str, NDArray]:
        ends = np.cumsum([len(position) for position in self.info.paths.values()])
        return dict(zip(self.info.paths, np.split(array, ends[:-1]), strict=True))
