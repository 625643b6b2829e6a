"""Owns who carries out the jobs of a sweep: this process, worker processes of its own, or a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from queue import SimpleQueue
from typing import Any

from warp_mca.base import validate
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.studies.sweep_plan import RunOptions
from warp_mca.studies.worker_process import Function, Prepare, Worker, unheard
from warp_mca.system.threads import thread_count

DASK = "dask://"
CONNECTING = "10s"  # at most, to a Dask scheduler
REMEDY = "give process, dask://HOST:PORT, or in Python a concurrent.futures.Executor"


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

    def __init__(self, devices: Sequence[str], prepare: Prepare | None = None, early: Worker | None = None) -> None:
        """Make ready; a process starts with its first job.

        Args:
            devices: of each worker.
            prepare: called by each of them first; None only keeps Warp from printing messages.
            early: the first of them, which was begun before.
        """
        self._workers = [Worker(prepare) if k or not early else early for k in range(len(devices))]
        self._idle: SimpleQueue[Worker] = SimpleQueue()
        for worker, worker.device in zip(self._workers, devices, strict=True):
            self._idle.put(worker)
        self._threads = unheard(len(devices), "sweep")

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


@contextmanager
def early_worker(
    options: RunOptions, executor: object, workers: int | None, runs: int, prepare: Prepare | None = None
) -> Iterator[Worker | None]:
    """A process for the first jobs of a sweep of so many runs on a GPU, which starts while its scenes are made.

    None where this process or other executors carry them out, or on a CPU, which it would only keep from that.
    """
    if options.device == "cpu" or not own_workers(executor) or (workers == 1 and executor is None):
        yield None
        return
    worker = Worker(partial(_prepare, prepare, options, workers, runs))
    worker.begin()
    try:
        yield worker
    finally:
        worker.end()


def _prepare(prepare: Prepare | None, options: RunOptions, workers: int | None, runs: int) -> None:
    """Begin the helpers of a worker on a GPU with its process: each of its batches alone would be too few scenes.

    They begin before the driver does, where it is known how many workers share the cores.
    """
    from warp_mca.phases.by_helpers import begin_for
    from warp_mca.step.device import devices_named

    cores, share = thread_count(None), workers or (1 if options.device != "cuda" else 0)
    if share:
        begin_for(runs, min(options.threads or cores // share, cores))
    if prepare:
        prepare()
    if not share:
        with suppress(RequestError):  # no GPU, which the process that began this one says
            begin_for(runs, min(options.threads or cores // len(devices_named(options.device)), cores))


@contextmanager
def opened_executor(
    executor: Executor | str | None, devices: Sequence[str], count: int, prepare: Prepare | None, early: Worker | None
) -> Iterator[tuple[Executor, int | None]]:
    """An executor, and how many jobs it should have at a time (None for all).

    Args:
        executor: as `connected` gives it; None for this process.
        devices: which our own workers share out.
        count: their number.
        prepare, early: as in `Workers`.
    """
    if isinstance(executor, Executor):
        yield executor, None
    elif executor is None:
        yield Here(), 1
    else:
        with Workers(
            [devices[k % len(devices)] for k in range(count)], early.prepare if early else prepare, early
        ) as workers:
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


def worker_count(options: RunOptions, workers: int | None, devices: Sequence[str]) -> int:
    """The number of workers: as asked for, or one for each GPU, or as many as the cores have threads for."""
    usual = len(devices) if devices != ["cpu"] else max(1, thread_count(None) // (options.threads or 1))
    return workers or usual
