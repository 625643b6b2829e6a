"""Owns the transfer of frames to the recorders, which work on one while the device computes the next."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.arrays import Index
from warp_mca.geometry.exposure import Exposure
from warp_mca.recorders.checks import files_of
from warp_mca.recorders.frame_parts import FrameParts, Times, frame_values, rows_of_phase, wanted_rows
from warp_mca.recorders.recorder import (
    Frame,
    Recorder,
    RunInfo,
    SurfaceMesh,
)
from warp_mca.step.transfer import SLOTS, Transfer

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.step.output import Output
    from warp_mca.system.block import Block
    from warp_mca.system.model import Model


# Frames on their way from a GPU, which goes on meanwhile: while recorders start, or save their files.
AHEAD, AHEAD_BYTES = 16, 64 << 20  # at most, and their size together
# A GPU is given work first, and recorders have the time in which it need not be given more. Where that never comes,
# they have their turn between rows once they have had none for as long.
PATIENCE = 0.25  # [s]
LAST = 3  # frames that are still to come when recorders begin to write each at once, so that little is left at the end


def skins(model: Model, meshes: Mapping[str, Mesh]) -> dict[str, SurfaceMesh]:
    """The skin of each body in the model's numbering."""
    found = {}
    failing = np.concatenate([np.zeros(0, int), *(_elements(model, block) for block in model.blocks if block.failing)])
    for body, mesh in meshes.items():
        (quads, _), between = mesh.boundary, None
        start = model.element_start[body]
        if ((failing >= start) & (failing < start + mesh.cell_count)).any():
            quads, between = Exposure(mesh).possible()
            between = np.where(between < 0, -1, between + start).astype(np.int32)
        nodes = np.unique(quads)
        local = np.searchsorted(nodes, quads).astype(np.int32)
        found[body] = SurfaceMesh((nodes + model.node_start[body]).astype(np.int32), local, between)
    return found


def _elements(model: Model, block: Block) -> Index:
    """Elements of a block as counted in the concatenated meshes."""
    return model.element_of[block.first : block.first + block.conn.shape[1]]


def _begin(index: int, recorder: Recorder, method: str, info: RunInfo) -> None:
    """Let a recorder check or start.

    Raises:
        RequestError: it failed.
    """
    validate.call(f"recorders[{index}]", recorder.name, f"{method}()", getattr(recorder, method), info)


class Recording:
    """The recorders of one run. Beside a GPU they start and work while it has work.

    Attributes:
        failed: names of the recorders that failed; what they write, mostly a file, is missing or ends too early.
    """

    def __init__(
        self, recorders: Sequence[Recorder], info: RunInfo, intervals: int, steps: int, output: Output | None
    ) -> None:
        """Check the recorders of a run of `intervals` output intervals of `steps` steps each, and start them.

        Raises:
            RequestError: an output cannot be made, or a time is not reached; what others had made by then is removed.
        """
        wanted = [wanted_rows(recorder, intervals, info) for recorder in recorders]
        for k, recorder in enumerate(recorders):
            if hasattr(recorder, "check"):
                _begin(k, recorder, "check", info)
        self.failed: list[str] = []
        self.info = info
        self.rows: list[tuple[Recorder, NDArray[np.bool_]]] = list(zip(recorders, wanted, strict=True))
        self.taken: dict[int, int] = {}
        self.parts = FrameParts(info)
        self.started = False
        self.times = Times(0.0, info.output_interval, steps)
        self._read(output)

    def follow(
        self,
        begin: float,
        interval: float,
        intervals: int,
        *,
        output: Output | None = None,
        shift: NDArray[np.float32] | None = None,
    ) -> None:
        """Go on with the frames of another phase, once those of the one before are passed on.

        Args:
            begin: time of its first row [s].
            interval: between its rows [s].
            intervals: number of these; it may end earlier.
            output: of the solver that computes it; None for rigid bodies, whose frames `show` takes.
            shift: displacement of the nodes [m] where those of the solver are zero, shape (node_count, 3), float32.
        """
        until = self.times.of(self.row) if self.row >= 0 else -np.inf
        self.times, self.parts.shift = Times(begin, interval, round(interval / self.info.dt)), shift
        self.rows = [(item, rows_of_phase(item.cadence, begin, interval, intervals, until)) for item, _ in self.rows]
        self._read(output)

    def _read(self, output: Output | None) -> None:
        """Take frames from what a solver shows, and start the recorders if nothing computes beside them."""
        self.output, self.row = output, -1  # the latest row that was offered
        self.transfer: Transfer[tuple[str, str]] | None = None
        self.patience = PATIENCE if output and _computes_beside(output) else 0.0
        self.due = time.monotonic() + self.patience  # when they have their turn between rows [s]
        if output and self.rows:
            arrays = {(need, name): a for need, group in output.arrays.items() for name, a in group.items()}
            self.transfer = Transfer(arrays, output.solver.device, _sets(output, arrays.values()))
        if not self.patience:
            self.start()

    def start(self) -> None:
        """Start the recorders, unless they are.

        Raises:
            RequestError: as when made.
        """
        if self.started:
            return
        self.started = True
        waiting, self.rows = self.rows, []
        missing = {folder for recorder, _ in waiting for folder in _missing_folders(recorder)}
        try:
            for k, (recorder, wanted) in enumerate(waiting):
                self.rows.append((recorder, wanted))
                _begin(k, recorder, "start", self.info)
        except BaseException:
            self._close(False)
            for folder in sorted(missing, reverse=True):  # the inner ones first
                with suppress(OSError):
                    folder.rmdir()
            raise

    def needs(self, row: int) -> frozenset[str]:
        """What a frame at the end of interval `row` must hold; empty when none is due."""
        self.row = row
        return frozenset().union(*(recorder.needs for recorder, rows in self.rows if rows[row]))

    def take(self, row: int, needs: frozenset[str]) -> None:
        """Copy the frame that the step launched last has reduced; pass on one that has arrived, if it is time.

        Raises:
            RequestError: as when made.
        """
        if self.transfer is None:
            return
        if needs:
            if self.transfer.full:
                self._deliver(self.transfer)
            self.transfer.send(row, [key for key in self.transfer.source if key[0] in needs])
        if time.monotonic() < self.due:
            return
        self.start()
        if self.transfer.arrived:
            self._deliver(self.transfer)
        else:
            self.due = time.monotonic() + self.patience

    def show(self, row: int, make: Callable[[frozenset[str]], Mapping[tuple[str, str], NDArray]]) -> None:
        """Pass on a frame of rigid bodies, if one is due; `make` gives what it needs as the arrays of an `Output`."""
        if needs := self.needs(row):
            self._pass_on(row, make(needs))

    def work(self, until: Callable[[], bool]) -> None:
        """Pass on frames that have arrived while the device has work, until it may be given more.

        Raises:
            RequestError: as when made.
        """
        self.start()
        while self.transfer and self.transfer.arrived and not until():
            self._deliver(self.transfer)

    def catch_up(self, beside: Callable[[], None] = lambda: None) -> None:
        """Pass on the frames that are still being copied, one after the other as they arrive, each after `beside`.

        Raises:
            RequestError: as when made.
        """
        while self.transfer and self.transfer.pending:
            self.start()
            beside()
            if len(self.transfer.pending) <= LAST and not self.transfer.arrived:
                for recorder, _ in list(self.rows):
                    self._call(recorder, getattr(recorder, "idle", lambda: None))
            self._deliver(self.transfer)

    def history(self, make: Callable[[], Mapping[str, NDArray[np.float64]]]) -> None:
        """Pass on further rows of the history, which are made only if someone takes them."""
        self.start()
        rows = make() if self.rows else {}
        for recorder, _ in list(self.rows):
            self._call(recorder, lambda recorder=recorder: recorder.history(rows))

    def finish(self, ok: bool) -> None:
        """Pass on the frames that are still being copied, of a run that failed those that have come, and close."""
        if ok:
            self.start()
            self.catch_up()
        while self.started and self.transfer and self.transfer.arrived:
            self._deliver(self.transfer)
        self._close(ok)

    def _close(self, ok: bool) -> None:
        for recorder, _ in list(self.rows if self.started else ()):
            self._call(recorder, getattr(recorder, "before_finish", lambda: None))
        # What goes on beside others is waited for last.
        for recorder, _ in sorted(self.rows if self.started else (), key=_goes_on_beside):
            self._call(recorder, lambda recorder=recorder: recorder.finish(ok))
            if getattr(recorder, "failed", False):
                self.failed.append(recorder.name)
        self.rows = []

    def _deliver(self, transfer: Transfer[tuple[str, str]]) -> None:
        self.start()
        self._pass_on(*transfer.receive())

    def _pass_on(self, row: int, arrays: Mapping[tuple[str, str], NDArray]) -> None:
        parts = self.parts.of(arrays)
        for recorder, rows in list(self.rows):
            if rows[row]:
                index = self.taken.get(id(recorder), 0)
                time, step = self.times.of(row), self.times.step(row, self.info.dt)
                frame = Frame(index=index, step=step, time=time, **frame_values(parts, recorder.needs))
                self._call(recorder, lambda recorder=recorder, frame=frame: recorder.frame(frame))
                self.taken[id(recorder)] = index + 1

    def _call(self, recorder: Recorder, act: Callable[[], None]) -> None:
        """Call a recorder; one that fails is closed and not called again."""
        try:
            act()
        except (Exception, SystemExit) as error:
            count = self.taken.get(id(recorder), 0)
            reason = " ".join(str(error).split()) or type(error).__name__
            self.info.warn(f"{recorder.name}: recording stopped after {count} frames: {reason}")
            self.failed.append(recorder.name)
            self.rows = [item for item in self.rows if item[0] is not recorder]
            with suppress(Exception, SystemExit):
                recorder.finish(False)


def _goes_on_beside(row: tuple[Recorder, object]) -> bool:
    """Whether a recorder begins to close before others finish."""
    return hasattr(row[0], "before_finish")


def _missing_folders(recorder: Recorder) -> set[Path]:
    return {folder for file in files_of([recorder]) for folder in file.parents if not folder.exists()}


def _computes_beside(output: Output) -> bool:
    """Whether the device computes while the host does something else."""
    return wp.get_device(output.solver.device).is_cuda


def _sets(output: Output, arrays: Iterable[wp.array]) -> int:
    """Frames of such arrays that may be under way."""
    if not _computes_beside(output):
        return SLOTS  # they arrive at once
    size = sum(array.capacity for array in arrays)
    return max(SLOTS, min(AHEAD, AHEAD_BYTES // max(1, size)))
