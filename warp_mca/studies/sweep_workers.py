"""Owns who carries out the jobs of a sweep: this process, worker processes of its own, or a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from multiprocessing import connection
from queue import SimpleQueue
from typing import Any

from warp_mca.base import validate
from warp_mca.base.errors import McaError, bad_value
from warp_mca.studies.sweep_job import DeviceLost
from warp_mca.studies.sweep_plan import RunOptions

DASK = "dask://"
STARTS = 5  # of a worker in turn that is killed before it is ready, after which a sweep gives up
CONNECTING = "10s"  # at most, to a Dask scheduler
REMEDY = "give process, dask://HOST:PORT, or in Python a concurrent.futures.Executor"

Function = Callable[[Any], Any]  # of a job, which has `on(device)`
Prepare = Callable[[], None]


class WorkerDied(BrokenExecutor):
    """The process that carried out a job ended before it had an answer."""


class Here(Executor):
    """Carries out each job at once, in this process."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """A future that is done."""
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


class Workers(Executor):
    """Processes that carry out one job after the other, each on its device.

    One that is killed, or whose device takes no more work, is replaced by a new one, and only the job that it had is
    lost: its future raises `WorkerDied`.
    """

    def __init__(self, devices: Sequence[str], prepare: Prepare | None = None) -> None:
        """Make ready; a process starts with its first job.

        Args:
            devices: of each worker.
            prepare: called by each of them first; None only keeps Warp from printing messages.
        """
        self._workers = [_Worker(device, prepare) for device in devices]
        self._idle: SimpleQueue[_Worker] = SimpleQueue()
        for worker in self._workers:
            self._idle.put(worker)
        # Workers start with the signal mask of these threads: an interrupt from the keyboard is for this process alone.
        block = (signal.SIG_BLOCK, {signal.SIGINT})
        self._threads = ThreadPoolExecutor(len(devices), "sweep", signal.pthread_sigmask, block)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have a worker carry out `fn(job)`; the job is the only argument."""
        return self._threads.submit(self._call, fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, whatever they are doing."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.end()
        self._threads.shutdown(wait=wait)

    def _call(self, function: Function, job: Any) -> Any:
        worker = self._idle.get()
        try:
            return worker.call(function, job)
        finally:
            self._idle.put(worker)


class _Worker:
    """A process and the pipe to it; used by one thread at a time, but for `end`."""

    def __init__(self, device: str, prepare: Prepare | None) -> None:
        self.device, self._prepare = device, prepare
        self._process: Any = None
        self._pipe: connection.Connection | None = None
        self._ended = threading.Event()

    def call(self, function: Function, job: Any) -> Any:
        """What the process answers.

        Raises:
            WorkerDied: it ended before.
            McaError: none can be started.
        """
        pipe = self._pipe if self._process and self._process.is_alive() and self._pipe else self._start()
        try:
            pipe.send((function, job.on(self.device)))
            answer, error, lost = pipe.recv()
        except (EOFError, OSError) as broken:
            raise WorkerDied(self._how_it_ended()) from broken
        if lost:
            self._process.join()
            raise WorkerDied(error)
        if error is not None:
            raise RuntimeError(error)
        return answer

    def end(self) -> None:
        """Kill the process, and start none any more."""
        self._ended.set()
        if self._process:
            self._process.kill()

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
            process = context.Process(target=_serve, args=(theirs, self._prepare), daemon=True)
            process.start()
            theirs.close()
            self._process = process
            if self._ended.is_set():  # meanwhile
                process.kill()
            try:
                ours.recv()
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
        self._process.join()
        code = self._process.exitcode
        return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"


def _serve(pipe: connection.Connection, prepare: Prepare | None) -> None:
    """Carry out jobs until nobody sends any."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if prepare:
        prepare()
    else:
        import warp

        warp.config.log_level = warp.LOG_WARNING
    pipe.send(None)
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


@contextmanager
def opened_executor(
    executor: Executor | str | None, device: str, count: int, prepare: Prepare | None
) -> Iterator[tuple[Executor, int | None]]:
    """An executor, and how many jobs it should have at a time (None for all).

    Args:
        executor: as `connected` gives it; None for this process.
        device: of our own workers.
        count: their number.
        prepare: as in `Workers`.
    """
    if isinstance(executor, Executor):
        yield executor, None
    elif executor is None:
        yield Here(), 1
    else:
        devices = devices_named(device)
        with Workers([devices[k % len(devices)] for k in range(count)], prepare) as workers:
            yield workers, 2 * count


def check_executor(executor: object) -> None:
    """Refuse what is no executor.

    Raises:
        RequestError: so it is.
    """
    named = isinstance(executor, str) and (executor == "process" or executor.startswith(DASK))
    if not (executor is None or named or isinstance(executor, Executor)):
        raise bad_value("executor", validate.brief(executor), REMEDY)


def own_workers(executor: object) -> bool:
    """Whether the jobs are carried out by this process or processes that it starts."""
    return executor in (None, "process")


@contextmanager
def connected(executor: Executor | str | None) -> Iterator[Executor | str | None]:
    """That executor; of "dask://HOST:PORT" that of the cluster whose scheduler has this address.

    Raises:
        RequestError: nobody answers there, or the package is missing.
    """
    if not (isinstance(executor, str) and executor.startswith(DASK)):
        yield executor
        return
    try:
        distributed = import_module("distributed")
    except ImportError as error:
        what = "it takes the package distributed: pip install 'warp_mca[cluster]'"
        raise bad_value("executor", executor, what) from error
    try:
        client = distributed.Client(f"tcp://{executor.removeprefix(DASK)}", timeout=CONNECTING, set_as_default=False)
    except (OSError, ValueError) as error:
        raise bad_value("executor", executor, "no Dask scheduler answers there; give dask://HOST:PORT") from error
    try:
        yield client.get_executor(pure=False)
    finally:
        client.close()


def lost_worker(error: BaseException) -> bool:
    """Whether a job failed because its worker ended; Dask has an error of its own for it."""
    return isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker"


def worker_count(options: RunOptions, workers: int | None) -> int:
    """The number of workers: as asked for, or one for each GPU of the device, or as many as the cores have threads for.

    Raises:
        RequestError: there is no such device.
    """
    from warp_mca.system.threads import thread_count

    devices = devices_named(options.device)
    usual = len(devices) if devices != ["cpu"] else max(1, thread_count(None) // (options.threads or 1))
    return workers or usual


def devices_named(name: str) -> list[str]:
    """The devices of that name: "cuda" stands for all GPUs.

    Raises:
        RequestError: there is none.
    """
    import warp as wp

    from warp_mca.step.device import check_device

    wp.init()
    return (name == "cuda" and [str(device) for device in wp.get_cuda_devices()]) or [check_device(name)]
