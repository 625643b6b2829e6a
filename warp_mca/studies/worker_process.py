"""Owns one worker process of a sweep, and the pipe to it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from multiprocessing import connection
from typing import Any

from warp_mca.base.errors import McaError

STARTS = 5  # of a worker in turn that is killed before it is ready, after which a sweep gives up

Function = Callable[[Any], Any]  # of a job, which has `on(device)`
Prepare = Callable[[], None]


class DeviceLost(BrokenExecutor):
    """The device takes no more work of this process; another process may have it do the job."""


class WorkerDied(BrokenExecutor):
    """The process that carried out a job ended before it had an answer."""


class Worker:
    """A process and the pipe to it; used by one thread at a time, but for `end`."""

    def __init__(self, prepare: Prepare | None, device: str = "cpu") -> None:
        """One that starts with its first job; see `Workers` for the arguments."""
        self.prepare, self.device = prepare, device
        self.process: Any = None
        self._pipe: connection.Connection | None = None
        self._begun: Future[connection.Connection] | None = None
        self._known: list[str] = []
        self._ended = threading.Event()

    def begin(self) -> None:
        """Start the process while this one goes on."""
        thread = unheard(1, "sweep-begin")
        self._begun = thread.submit(self._start)
        thread.shutdown(wait=False)

    def devices(self) -> list[str]:
        """Those that its process finds on this machine.

        Raises:
            McaError: as in `call`.
        """
        self._ready()
        return self._known

    def call(self, function: Function, job: Any) -> Any:
        """What the process answers.

        Raises:
            WorkerDied: it ended before.
            McaError: none can be started.
        """
        pipe = self._ready()
        try:
            pipe.send((function, job.on(self.device)))
            answer, error, lost = pipe.recv()
        except (EOFError, OSError) as broken:
            raise WorkerDied(self._how_it_ended()) from broken
        if lost:
            self.process.join()
            raise WorkerDied(error)
        if error is not None:
            raise RuntimeError(error)
        return answer

    def end(self) -> None:
        """Kill the process, and start none any more."""
        self._ended.set()
        if self.process:
            self.process.kill()

    def _ready(self) -> connection.Connection:
        """The pipe to its process, which runs; raises as `_start`."""
        begun, self._begun = self._begun, None
        if begun:
            begun.result()
        return self._pipe if self.process and self.process.is_alive() and self._pipe else self._start()

    def _start(self) -> connection.Connection:
        """The pipe to a new process that is ready.

        Raises:
            McaError: it ends before it is, or several in turn are killed before.
        """
        context = multiprocessing.get_context("spawn")  # a copy of this process would share its threads and its GPU
        why = ""
        for _ in range(STARTS):
            if self._ended.is_set():
                raise WorkerDied("the sweep has ended")
            ours, theirs = context.Pipe()
            process = context.Process(target=_serve, args=(theirs, self.prepare), daemon=True)
            process.start()
            theirs.close()
            self.process = process
            if self._ended.is_set():  # meanwhile
                process.kill()
            try:
                self._known = ours.recv()
            except (EOFError, OSError):
                why = self._how_it_ended()
                if (process.exitcode or 0) >= 0:  # not killed: the next one would end the same way
                    break
                continue
            self._pipe = ours
            return ours
        raise McaError(
            f"worker processes end before they are ready ({why}); a script must call mca.sweep under "
            "if __name__ == '__main__', because they read it too, or with workers=1"
        )

    def _how_it_ended(self) -> str:
        self.process.join()
        code = self.process.exitcode
        return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"


def unheard(count: int, name: str) -> ThreadPoolExecutor:
    """Threads that start processes: these have their signal mask, so that an interrupt is for this process alone."""
    return ThreadPoolExecutor(count, name, signal.pthread_sigmask, (signal.SIG_BLOCK, {signal.SIGINT}))


def _serve(pipe: connection.Connection, prepare: Prepare | None) -> None:
    """Carry out jobs until nobody sends any."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    import warp

    warp.config.log_level = warp.LOG_WARNING
    if prepare:
        prepare()
    warp.init()
    pipe.send([str(device) for device in warp.get_devices()])
    while True:
        try:
            function, job = pipe.recv()
            answer, error, lost = function(job), None, False
        except EOFError:
            return
        except DeviceLost as failed:
            answer, error, lost = None, str(failed), True
        except Exception as wrong:  # a job whose classes cannot be imported here
            answer, error, lost = None, f"{type(wrong).__name__}: {wrong}", False
        pipe.send((answer, error, lost))
        if lost:
            return


def _end_with_parent() -> None:
    """End this process when the one that started it does, however that ends: nobody waits for its answer."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    connection.wait([parent.sentinel])
    os._exit(1)
