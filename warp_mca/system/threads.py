"""Owns the threads of a CPU run: ranges of elements and nodes side by side, one stage after the other.

A range is a captured graph, whose replay leaves the interpreter's lock. Which thread computes a range changes nothing
in it, and no sum is cut, so that results do not depend on the number of threads.
"""

from __future__ import annotations

import os
import threading
import weakref
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from itertools import pairwise
from numbers import Integral
from queue import SimpleQueue
from typing import Any

import warp as wp

from warp_mca.base.errors import bad_value
from warp_mca.kernels.hardware.simd import RANGE_MULTIPLE
from warp_mca.kernels.hardware.subnormals import begin_flush, end_flush

Task = Callable[[], object]
Launch = Callable[[slice], None]  # of the elements or nodes of a range
Split = Callable[[int, Launch, int], None]  # (count, launch, least length of a range)

# Least length of a range, about 0.1 ms: to pass one to a thread costs about 0.02 ms.
ELEMENTS, NODES, CONTACT = 1024, 4096, 512
MOST = 4096  # threads that can be asked for
RANGES = 4  # for each thread: one that is held up, or meets more that yields, leaves ranges to the others


def thread_count(threads: int | None) -> int:
    """The number of threads: `threads`, or all cores that this process may use if None.

    Raises:
        RequestError: it is no whole number above 0.
    """
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, Integral) or not 1 <= threads <= MOST:
        remedy = f"give a whole number of threads from 1 to {MOST:,}, or leave it out for all cores"
        raise bad_value("threads", threads, remedy)
    return int(threads)


def whole(count: int, launch: Launch, least: int) -> None:
    """Launch everything at once."""
    launch(slice(0, count))


class Flush:
    """While it is entered, subnormal numbers are zero in the present thread of a CPU; it is not entered twice."""

    def __init__(self) -> None:
        """Load the kernels."""
        before, until_now = (wp.zeros(1, dtype=wp.uint32, device="cpu") for _ in range(2))
        self._begin: Any = wp.launch(begin_flush, 1, outputs=[before], device="cpu", record_cmd=True)
        self._end: Any = wp.launch(end_flush, 1, inputs=[before], outputs=[until_now], device="cpu", record_cmd=True)

    def __enter__(self) -> None:
        self._begin.launch()

    def __exit__(self, *_: object) -> None:
        self._end.launch()


def flushing(device: Any) -> AbstractContextManager[object]:
    """Within it a CPU takes subnormal numbers for zero in this thread; fast math on a GPU does anyway."""
    return nullcontext() if wp.get_device(device).is_cuda else Flush()


class Pool:
    """Worker threads that share the tasks of a stage with the thread that calls; a task that fails ends them."""

    def __init__(self, threads: int) -> None:
        """Make ready for `threads` - 1 of them, which start with the first tasks."""
        self._done: SimpleQueue[BaseException | None] = SimpleQueue()
        self._inboxes: list[SimpleQueue[deque[Task] | None]] = [SimpleQueue() for _ in range(threads - 1)]
        self._workers: list[threading.Thread] = []
        self._finalizer = weakref.finalize(self, _stop, self._inboxes)

    def _start(self) -> None:
        """Start the threads and wait until they are ready: Warp may not launch anything while another captures."""
        self._workers = [
            threading.Thread(target=_work, args=(Flush(), inbox, self._done), name=f"warp_mca-{k}", daemon=True)
            for k, inbox in enumerate(self._inboxes, 1)
        ]
        for worker in self._workers:
            worker.start()
        for _ in self._workers:
            if error := self._done.get():
                raise error

    def run(self, tasks: Sequence[Task]) -> None:
        """Carry out the tasks, in any order, and return when all are done.

        Raises:
            Exception: what a task raised, once no other is under way.
        """
        shared = deque(tasks)
        try:
            if not self._workers:
                self._start()
            for inbox in self._inboxes[: len(tasks) - 1]:
                inbox.put(shared)
            left = len(tasks)
            for task in _taken(shared):
                task()
                left -= 1
            for _ in range(left):  # taken by others; who came too late to take one is not waited for
                if error := self._done.get():
                    raise error
        except BaseException:  # an interrupt too: no thread may still write to arrays that are about to go
            shared.clear()
            self.close()
            raise

    def close(self) -> None:
        """End the threads once their tasks are done."""
        self._finalizer()
        for worker in self._workers:
            worker.join()


def _taken(tasks: deque[Task]) -> Iterator[Task]:
    """Tasks that no other thread has taken, until none is left."""
    while True:
        try:
            task = tasks.popleft()
        except IndexError:
            return
        yield task


def _work(flush: Flush, inbox: SimpleQueue[deque[Task] | None], done: SimpleQueue[BaseException | None]) -> None:
    try:
        flush.__enter__()  # for good: the thread does nothing else
    except BaseException as error:
        done.put(error)
        return
    done.put(None)
    while (tasks := inbox.get()) is not None:
        try:
            for task in _taken(tasks):
                task()
                done.put(None)
        except BaseException as error:
            tasks.clear()
            done.put(error)


def _stop(inboxes: Sequence[SimpleQueue[deque[Task] | None]]) -> None:
    for inbox in inboxes:
        inbox.put(None)


class Stages:
    """A step as stages of graphs: those of one stage run side by side, each stage after the one before it."""

    def __init__(self, threads: int, body: Callable[[Split], None]) -> None:
        """Capture what `body` launches on the present device; it gets the function that splits a launch."""
        self.threads = threads
        self._stages: list[list[Task]] = []
        self._begin()
        try:
            body(self._split)
        finally:
            self._end()

    def replay(self, pool: Pool) -> None:
        """One step.

        Raises:
            Exception: as in `Pool.run`.
        """
        for stage in self._stages:
            if len(stage) == 1:
                stage[0]()
            else:
                pool.run(stage)

    def _begin(self) -> None:
        self._capture = wp.ScopedCapture()
        self._capture.__enter__()

    def _end(self) -> None:
        if self._capture.active:  # not where capturing a range failed
            self._capture.__exit__(None, None, None)
            self._stages.append([_task(self._capture.graph)])

    def _split(self, count: int, launch: Launch, least: int) -> None:
        parts = min(RANGES * self.threads, count // least)
        if parts > self.threads:
            parts -= parts % self.threads  # as many for each thread
        if parts < 2:
            launch(slice(0, count))
            return
        self._end()
        stage: list[Task] = []
        ends = [count * k // parts // RANGE_MULTIPLE * RANGE_MULTIPLE for k in range(parts)] + [count]
        for start, end in pairwise(ends):
            with wp.ScopedCapture() as capture:
                launch(slice(start, end))
            stage.append(_task(capture.graph))
        self._stages.append(stage)
        self._begin()


def _task(graph: Any) -> Task:
    return partial(wp.capture_launch, graph)
