"""Owns the threads of a CPU run: ranges of elements and nodes side by side, one stage after the other.

A range is a captured graph, which threads replay without the interpreter: see `kernels.hardware.thread_pool`. Which
thread computes it changes nothing in it, and no sum is cut, so that results do not depend on the number of threads.
"""

from __future__ import annotations

import math
import os
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from contextlib import suppress
from ctypes import c_void_p, cast
from itertools import accumulate, pairwise
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from warp_mca.base.errors import bad_value
from warp_mca.kernels.hardware.simd import RANGE_MULTIPLE
from warp_mca.kernels.hardware.thread_pool import CLAIMS, FAILED, LINE, READY, STOPPED, lead, serve

Launch = Callable[[slice], None]  # of the elements or nodes of a range
Split = Callable[[int, Launch, int], None]  # (count, launch, least length of a range)

# Least length of a range, about 10 us: threads meet in about 1 us.
ELEMENTS, NODES, CONTACT = 128, 512, 64
MOST = 4096  # threads that can be asked for
GROUP = Path("/sys/fs/cgroup")  # what Linux tells of the group of a process
UNHEARD = 0.1  # time for which signals may have to wait [s]
RANGES = 4  # for each thread: one that is held up, or meets more that yields, leaves ranges to the others


def thread_count(threads: int | None) -> int:
    """The number of threads: `threads`, or as many as the cores that this process may use if None.

    Raises:
        RequestError: it is no whole number above 0.
    """
    if threads is None:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        return max(1, min(cores, _quota()))
    if isinstance(threads, bool) or not isinstance(threads, Integral) or not 1 <= threads <= MOST:
        remedy = f"give a whole number of threads from 1 to {MOST:,}, or leave it out for all cores"
        raise bad_value("threads", threads, remedy)
    return int(threads)


def _quota() -> int:
    """Cores whose time a container may take, where it has a quota: threads beyond it would stop all others."""
    for quota, period in (
        ("cpu.max", ""),  # both in one line, "max" for no quota
        ("cpu/cpu.cfs_quota_us", "cpu/cpu.cfs_period_us"),  # -1 for no quota
    ):
        with suppress(OSError, ValueError):
            words = (GROUP / quota).read_text().split() + ((GROUP / period).read_text().split() if period else [])
            share = float(words[0]) / float(words[1])
            return math.ceil(share) if share > 0.0 else MOST
    return MOST


def whole(count: int, launch: Launch, least: int) -> None:
    """Launch everything at once."""
    launch(slice(0, count))


class Pool:
    """Threads that compute programs: that of the caller, and others from the first program on.

    Attributes:
        threads: their number.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._words: dict[int, Any] = {}
        self._lead: Any = None

    def run(self, program: Program, repeats: int) -> None:
        """Compute a program so many times.

        Raises:
            RuntimeError: a graph cannot be replayed.
        """
        leading = self._lead = self._lead or self._start()
        self._words[program.address] = program.words  # a thread that was held up may read them when all is done
        leading.set_param_at_index(2, program.address)
        while repeats:
            part, begun = min(repeats, program.at_once), time.perf_counter()
            leading.set_param_at_index(3, part)
            leading.launch()
            repeats, seconds = repeats - part, (time.perf_counter() - begun) / part
            program.at_once = max(1, int(UNHEARD / seconds))
        if self._board[FAILED]:
            raise RuntimeError("Warp cannot replay a graph that it captured")

    def _start(self) -> Any:
        """Start the threads and wait until they are ready: Warp may not launch anything while another captures.

        Returns:
            The launch by which the caller leads them.
        """
        replay = cast(_core().wp_apic_cpu_replay_state, c_void_p).value
        board = wp.zeros(CLAIMS + LINE * self.threads, dtype=wp.int64, device="cpu")
        self._board: Any = board.numpy()
        leading = _command(lead, [self.threads, replay, 0, 0, board])
        commands = [_command(serve, [k, self.threads, replay, board]) for k in range(1, self.threads)]
        workers = [
            threading.Thread(target=command.launch, name=f"warp_mca-{k}", daemon=True)
            for k, command in enumerate(commands, 1)
        ]
        self._finalizer = weakref.finalize(self, _stop, self._board, workers)
        for worker in workers:
            worker.start()
        while self._board[READY] < len(workers):
            time.sleep(1e-4)
        return leading

    def close(self) -> None:
        """End the threads; a program begins them anew."""
        if self._lead:
            self._lead = self._finalizer()


def _core() -> Any:
    """Warp's library: it has no public name for what `wp.capture_launch` calls."""
    from warp._src.context import runtime

    return runtime.core


def _command(kernel: Any, inputs: Sequence[Any]) -> Any:
    return wp.launch(kernel, 1, inputs=inputs, device="cpu", record_cmd=True)


def _stop(board: Any, workers: Sequence[threading.Thread]) -> None:
    board[STOPPED] = 1
    for worker in workers:
        if worker.is_alive():
            worker.join()


class Program:
    """What threads compute together: graphs of stages, each after the one before it.

    Attributes:
        stages: the graphs of each.
        words: what `kernels.hardware.thread_pool` reads: the number of stages, the first graph of each, the number of
            graphs, and the address of each, int64.
        address: of these.
        at_once: how often the program is computed before signals are heard.
    """

    def __init__(self, threads: int, body: Callable[[Split], None]) -> None:
        """Capture what `body` launches on the present device; it gets the function that splits a launch."""
        self.threads = threads
        self.stages: list[list[Any]] = []
        self._begin()
        try:
            body(self._split)
        finally:
            self._end()
        begins = accumulate(map(len, self.stages), initial=0)
        graphs = [cast(graph.apic_state, c_void_p).value for stage in self.stages for graph in stage]
        self.words = np.array([len(self.stages), *begins, *graphs], dtype=np.int64)
        self.address, self.at_once = self.words.ctypes.data, 1

    def _begin(self) -> None:
        self._capture = wp.ScopedCapture()
        self._capture.__enter__()

    def _end(self) -> None:
        if self._capture.active:  # not where capturing a range failed
            self._capture.__exit__(None, None, None)
            graph: Any = self._capture.graph
            if _core().wp_apic_get_operation_count(graph.apic_state):
                self.stages.append([graph])

    def _split(self, count: int, launch: Launch, least: int) -> None:
        parts = min(RANGES * self.threads, count // least)
        if parts > self.threads:
            parts -= parts % self.threads  # as many for each thread
        if parts < 2 or self.threads < 2:
            launch(slice(0, count))
            return
        self._end()
        stage = []
        ends = [count * k // parts // RANGE_MULTIPLE * RANGE_MULTIPLE for k in range(parts)] + [count]
        for start, end in pairwise(ends):
            with wp.ScopedCapture() as capture:
                launch(slice(start, end))
            stage.append(capture.graph)
        self.stages.append(stage)
        self._begin()
