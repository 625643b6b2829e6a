"""Owns sweeps: many runs, a row a run in a table that grows as they end and from which an interrupted sweep goes on."""

from __future__ import annotations

import math
import os
import time
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import contextmanager

from warp_mca.base import validate
from warp_mca.base.errors import McaError, bad_value
from warp_mca.base.files import check_folder
from warp_mca.base.folder import held
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.arguments import Progress, check_scene, span_of, teller
from warp_mca.phases.rate_groups import check_multi_rate
from warp_mca.results.storage import check_output, folder_path
from warp_mca.scene import Scene
from warp_mca.scene.options import with_options
from warp_mca.step.device import devices_named
from warp_mca.studies.sweep_columns import parameter_column
from warp_mca.studies.sweep_job import Job, Row, failure, job_of, run_job
from warp_mca.studies.sweep_plan import Plan, RunOptions, batches, differing
from warp_mca.studies.sweep_report import write_report
from warp_mca.studies.sweep_table import IDENTITY, SweepTable, check_identity, remove_sweep, write_identity
from warp_mca.studies.sweep_workers import (
    check_executor,
    connected,
    early_worker,
    lost_worker,
    opened_executor,
    own_workers,
    worker_count,
)
from warp_mca.studies.worker_process import Prepare, Worker
from warp_mca.system.threads import thread_count

TRIES = 5  # of a run whose worker ends before it
LATE = "not begun before the deadline; the same call goes on with it"
GO_ON = "if out names a folder, the others can be run by the same call"


def sweep(
    scenes: Iterable[Scene],
    *,
    executor: Executor | str | None = None,
    workers: int | None = None,
    batch: int | None = None,
    device: str = "cpu",
    precision: str = "mixed",
    threads: int | None = None,
    multi_rate: int | str | None = None,
    duration: float | None = None,
    out: str | os.PathLike[str] | None = None,
    folders: bool = False,
    force: bool = False,
    refine: float | None = None,
    mass_scaling: float | str | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Run scenes on several workers, and collect a row of figures of each.

    The same call goes on with what `out` holds: rows that are there stay, and runs that failed are tried again. A run
    whose worker is killed starts again on another one, 5 times at most. A script that calls this with workers of its
    own must do so under `if __name__ == "__main__"`, as for `concurrent.futures.ProcessPoolExecutor`.

    Args:
        scenes: what to run.
        executor: who runs them: any `concurrent.futures.Executor`; "dask://HOST:PORT", a Dask cluster; "process",
            processes on this machine. If None these too, or this process where there is one worker on a CPU, or
            `workers` is 1.
        workers: number of processes; one for each core, or each GPU, if None.
        batch: number of scenes at most that are computed in one model; None for as many as fill a GPU, one on a CPU.
        device: "cpu", a CUDA device as "cuda:0", or "cuda" for all GPUs.
        threads: of each run on the CPU; None shares the cores among the workers, and is one for an `executor`.
        precision, multi_rate, duration, refine, mass_scaling: as in `warp_mca.run`, for all scenes.
        out: folder for sweep.csv and sweep.parquet; nothing is written if None.
        folders: keep the files of each run in a folder of its own in `out`, named by its number from 0.
        force: start again, in place of what `out` holds.
        progress: called with a stage and the share of runs that have ended.

    Returns:
        A row for each scene: index, the parameters that differ (`parameter.NAME` where an entry of the summary has
        this name, or it has dots), status (done, criterion where one of the scene does not hold, stopped, failed),
        reason, all single values of its summary, warnings, wall time [s]. Stopped and failed runs have no figures.

    Raises:
        RequestError: the request cannot be carried out; nothing was written.
        McaError: the table cannot be written, or the executor has broken.
    """
    if isinstance(scenes, str | Mapping) or not isinstance(scenes, Iterable):
        raise bad_value("scenes", validate.brief(scenes), "give a list of scenes; mca.run runs a single one")
    for k, scene in enumerate(scenes := list(scenes)):
        check_scene(f"scenes[{k}]", scene)
    changed = tuple(with_options(scene, refine, mass_scaling, None) for scene in scenes)
    path = None if out is None else folder_path("out", out)
    options = RunOptions(device, precision, threads, check_multi_rate(multi_rate), duration)
    plan = Plan(changed, differing(changed), options, None, path, folders, batch)
    _check(plan, workers)
    with early_worker(options, executor, workers, len(changed)) as early:
        return carry_out(plan, executor=executor, workers=workers, force=force, progress=progress, early=early)


def carry_out(
    plan: Plan,
    *,
    executor: Executor | str | None = None,
    workers: int | None = None,
    force: bool = False,
    meshes: Mapping[str, Mesh] | None = None,
    prepare: Prepare | None = None,
    early: Worker | None = None,
    progress: Progress | None = None,
    deadline: float = math.inf,
) -> list[Row]:
    """As `sweep`, of a sweep that is planned.

    Args:
        plan: of the sweep.
        executor, workers, force, progress: as in `sweep`.
        meshes: of the plan's model file.
        prepare: called by each worker process before its first run.
        early: as `early_worker` gives it.
        deadline: no run begins later than this after the call [s]; the rows of others say so, but are not in the table.

    Raises:
        RequestError, McaError: as in `sweep`.
    """
    tell, end = teller(progress), time.monotonic() + deadline
    check_executor(executor)
    _check(plan, workers)
    groups = batches(plan, meshes)
    devices = devices_named(plan.options.device, early and early.devices()) if own_workers(executor) else []
    with connected(executor) as given, _opened(plan, force) as table:
        left = [group for group in groups if not table.rows.keys() >= set(group)]
        count = min(worker_count(plan.options, workers, devices), len(groups)) if devices else 0
        jobs = [job_of(plan, group, count) for group in left]
        if executor is None and (count > 1 or (plan.options.device != "cpu" and workers != 1)):
            given = "process"  # that a run of it ends badly is then not the end of the sweep
        with opened_executor(given, devices, count, prepare, early) as (pool, limit):
            _Driver(plan, pool, limit or len(jobs), table, tell, end).go_through(jobs)
        write_report(plan, rows := _all_rows(plan, table))
    return rows


def stored_rows(plan: Plan) -> list[Row]:
    """The rows that the folder of a sweep has, without a run and without its device; others are said to be left.

    Raises:
        RequestError, McaError: as in `sweep`.
    """
    with _opened(plan, force=False) as table:
        return _all_rows(plan, table)


def _all_rows(plan: Plan, table: SweepTable) -> list[Row]:
    """A row for each run: those that the table does not have were not begun."""
    return [table.rows.get(k) or {"index": k, **failure(LATE)} for k in range(len(plan.scenes))]


def _check(plan: Plan, workers: object) -> None:
    """Refuse what no run of the sweep could be carried out with.

    Raises:
        RequestError: there is no such precision, number of threads, of workers or of scenes in a batch.
    """
    options = plan.options
    if not plan.scenes:
        raise bad_value("scenes", [], "give at least one scene")
    for name, value in (("workers", workers), ("batch", plan.batch)):
        if not (value is None or (isinstance(value, int) and not isinstance(value, bool) and value > 0)):
            raise bad_value(name, validate.brief(value), "give a whole number above 0, or leave it out")
    for scene in plan.scenes:
        span_of(scene, options.duration)
    thread_count(options.threads)
    if options.precision not in ("mixed", "float64"):
        raise bad_value("precision", validate.brief(options.precision), "give mixed or float64")
    if plan.folders and plan.out is None:
        raise bad_value("folders", True, "name the folder for the files of the runs with out as well")


@contextmanager
def _opened(plan: Plan, force: bool) -> Iterator[SweepTable]:
    """The table of the sweep, in its folder, which no other run can write to meanwhile.

    Raises:
        RequestError: the folder holds something else, or another run holds it.
    """
    if plan.out is None:
        yield SweepTable(None)
        return
    check_folder("out", plan.out)
    with held(plan.out):
        identity = plan.identity()
        if force:
            remove_sweep(plan.out)
        check_identity(plan.out, identity)
        table = SweepTable(plan.out, plan.parameters[0])
        for k in range(len(plan.scenes)):
            if plan.folders and not (plan.out / IDENTITY).exists():
                check_output(plan.run_folder(k) or plan.out, force=force)
        write_identity(plan.out, identity)
        try:
            yield table
        except KeyboardInterrupt as stop:
            done = f"{len(table.rows)} of {len(plan.scenes)} runs are in {plan.out}"
            stop.add_note(f"{done}: the same command goes on with the others")
            raise
        finally:
            table.close()


class _Driver:
    """Hands jobs to an executor, and rows to the table as jobs end."""

    def __init__(
        self, plan: Plan, pool: Executor, limit: int, table: SweepTable, tell: Progress, end: float = math.inf
    ) -> None:
        """Of a plan; no job begins after `end` [s] of the monotonic clock."""
        self.plan, self.pool, self.limit, self.table, self.tell, self.end = plan, pool, limit, table, tell, end
        self.tries: Counter[tuple[int, ...]] = Counter()

    def go_through(self, jobs: Sequence[Job]) -> None:
        """Return when all jobs have ended, those that began before the end of the time.

        Raises:
            McaError: the executor takes no more, or rows cannot be written.
        """
        waiting = deque(jobs)
        running: dict[Future[list[Row]], Job] = {}
        try:
            while waiting or running:
                self.tell("sweep", len(self.table.rows) / len(self.plan.scenes))
                if time.monotonic() >= self.end:
                    waiting.clear()
                    running = {future: job for future, job in running.items() if not future.cancel()}
                while waiting and len(running) < self.limit:
                    job = waiting.popleft()
                    running[self._submit(job)] = job
                for future in wait(running, self._left(), return_when=FIRST_COMPLETED).done:
                    job = running.pop(future)
                    outcomes = self._outcomes(future, job)
                    if outcomes is None:
                        waiting.append(job)
                    else:
                        self._add(job, outcomes)
        finally:
            for future in running:
                future.cancel()

    def _left(self) -> float | None:
        """Time until the deadline [s]; None without a deadline, or after it."""
        left = self.end - time.monotonic()
        return left if 0.0 < left < math.inf else None

    def _submit(self, job: Job) -> Future[list[Row]]:
        try:
            return self.pool.submit(run_job, job)
        except (BrokenExecutor, RuntimeError) as error:
            raise McaError(f"the executor takes no more runs ({error}); {GO_ON} with a new executor") from error

    def _outcomes(self, future: Future[list[Row]], job: Job) -> list[Row] | None:
        """What came of each run of a job; None if it is to be tried again."""
        try:
            return future.result()
        except McaError:
            raise
        except CancelledError as error:
            raise McaError(f"the executor has cancelled runs; {GO_ON}") from error
        except Exception as error:
            if not lost_worker(error):
                return [failure(f"{type(error).__name__}: {error}")] * len(job.numbers)
            self.tries[job.numbers] += 1
            if self.tries[job.numbers] < TRIES:
                return None
            return [failure(f"its worker ended before it in each of {TRIES} tries: {error}")] * len(job.numbers)

    def _add(self, job: Job, outcomes: Sequence[Row]) -> None:
        """Put into the table what it does not have yet."""
        rows = []
        for number, outcome in zip(job.numbers, outcomes, strict=True):
            if number not in self.table.rows:
                parameters = self.plan.parameters[number].items()
                rows.append({"index": number, **{parameter_column(key): v for key, v in parameters}, **outcome})
        self.table.add(rows)
