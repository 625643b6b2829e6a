"""Owns what one worker of a sweep does: it runs the scenes of a batch, keeps their files, answers with their rows."""

from __future__ import annotations

import logging
import pickle
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from warp_mca.accuracy.simulation import run
from warp_mca.base.errors import GuardError, McaError
from warp_mca.base.log import LOGGER
from warp_mca.base.outside import import_named, imported
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.prepare import Request
from warp_mca.phases.settings import settings_of
from warp_mca.results.criteria import unmet
from warp_mca.results.result import Result
from warp_mca.results.storage import save
from warp_mca.scene import Scene, catalogue, model_file
from warp_mca.step.device import answers
from warp_mca.studies.batch import check_alike, judged
from warp_mca.studies.sweep_plan import Plan, RunOptions, one_line, plain
from warp_mca.studies.worker_process import DeviceLost
from warp_mca.system.threads import thread_count

Row = dict[str, Any]  # of a sweep's table, by column: texts, numbers, True or False, None

# What a row's status may be; "criterion": done, but a criterion of the scene does not hold.
DONE, CRITERION, STOPPED, FAILED = "done", "criterion", "stopped", "failed"
COMPLETE = (DONE, CRITERION)  # with figures
# entries of a summary that rows hold otherwise
NO_FIGURES = ("wall", "parameters", "batch", "warnings", "files", "units")
BETWEEN = " | "  # between the warnings of a run


@dataclass(frozen=True)
class Job:
    """Runs of a sweep that one worker carries out together.

    Attributes:
        numbers: of the runs in the sweep.
        scenes: one for each.
        folders: of their files, None where these are not kept.
        options: how they are run, on one device.
        model: model file that has the meshes of the scenes, or None.
    """

    numbers: tuple[int, ...]
    scenes: tuple[Scene, ...]
    folders: tuple[Path | None, ...]
    options: RunOptions
    model: Path | None = None

    def on(self, device: str) -> Job:
        """The same job on a device."""
        return replace(self, options=replace(self.options, device=device))

    def __reduce__(self) -> tuple[Callable[..., Job], tuple[object, ...]]:
        """Scenes travel as bytes, read once the modules and the scene files with their classes have been."""
        scenes = pickle.dumps(self.scenes)
        needed = imported(), catalogue.files_of(scenes)
        return _received, (*needed, self.numbers, scenes, self.folders, self.options, self.model)


def _received(
    modules: Mapping[str, str], files: Iterable[Path], numbers: tuple[int, ...], scenes: bytes, *rest: Any
) -> Job:
    for name, folder in modules.items():
        import_named("--import", name, folder)
    for file in files:
        catalogue.load_source(file)
    return Job(numbers, pickle.loads(scenes), *rest)


def job_of(plan: Plan, group: Sequence[int], count: int) -> Job:
    """A batch of runs of a sweep for one of `count` workers of our own, or for others if 0."""
    options = plan.options
    if options.threads is None:
        options = replace(options, threads=max(1, thread_count(None) // count) if count else 1)
    return Job(
        tuple(group),
        tuple(plan.scenes[k] for k in group),
        tuple(plan.run_folder(k) for k in group),
        options,
        plan.model,
    )


def _meshes(job: Job) -> Mapping[str, Mesh] | None:
    """The meshes of a job's model file, if it has one."""
    return _stored_meshes(job.model, job.model.stat().st_mtime_ns) if job.model else None


@lru_cache(maxsize=1)
def _stored_meshes(path: Path, changed: int) -> Mapping[str, Mesh]:
    """The meshes of the model file at `path`, `changed` at that time [ns]."""
    return model_file.load(path).meshes


def run_job(job: Job) -> list[Row]:
    """Carry out the runs of a job, and keep the files of those that no guard stopped.

    Scenes that cannot be run in one model run one by one. Nothing else that goes wrong in a run is raised.

    Returns:
        Of each run `status`, `reason`, `warnings`, figures and `wall`; no figures where it was stopped or failed.

    Raises:
        DeviceLost: the device takes no more work of this process.
    """
    device = job.options.device
    with _silent():
        if len(job.scenes) > 1:
            try:
                results = _batch(job)
            except Exception:
                pass
            else:
                return [_attempt(lambda k=k: _kept(results[k], job.folders[k]), device) for k in range(len(results))]
        return [_attempt(lambda k=k: _alone(job, k), device) for k in range(len(job.scenes))]


def failure(reason: str) -> Row:
    """The outcome of a run that failed."""
    return {"status": FAILED, "reason": one_line(reason)}


def _batch(job: Job) -> list[Result]:
    """As `run_batch`; stress along paths is in files alone, and takes most of what a small scene records."""
    options, meshes = job.options, _meshes(job)
    span = check_alike(job.scenes, options.duration)
    settings = settings_of(options.device, options.precision, options.threads)
    request = Request(span=span, settings=settings, paths=any(job.folders))
    return judged(job.scenes, [meshes] * len(job.scenes) if meshes else None, request)


def _alone(job: Job, k: int) -> Row:
    options = job.options
    result = run(
        job.scenes[k],
        device=options.device,
        precision=options.precision,
        threads=options.threads,
        multi_rate=options.multi_rate,
        duration=options.duration,
        out=job.folders[k],
        force=True,
        meshes=_meshes(job),
    )
    return _outcome(result)


def _kept(result: Result, folder: Path | None) -> Row:
    if result.stopped is not None:
        raise GuardError(result.stopped)
    return _outcome(save(result, folder, force=True) if folder else result)


def check_device_after(error: Exception, device: str) -> None:
    """Raise DeviceLost if the device takes no more work after that error."""
    if not answers(device):
        raise DeviceLost(f"{device} takes no more work of its process ({one_line(str(error))})") from error


def _attempt(attempt: Callable[[], Row], device: str) -> Row:
    """What the attempt returns, or the row of a run that was stopped or failed.

    Raises:
        DeviceLost: the device takes no more work of this process.
    """
    try:
        return attempt()
    except GuardError as error:
        return {"status": STOPPED, "reason": one_line(str(error))}
    except McaError as error:
        return failure(str(error))
    except Exception as error:  # whatever a user's own classes, the device or the disk raise
        check_device_after(error, device)
        return failure(f"{type(error).__name__}: {error}")


def _outcome(result: Result) -> Row:
    summary = result.summary
    rest = {key: value for key, value in summary.items() if key not in NO_FIGURES}
    wall = sum(summary["wall"].values())
    failed = unmet(summary)
    return {
        "status": CRITERION if failed else DONE,
        "reason": one_line("; ".join(failed)) if failed else None,
        **dict(figures(rest)),
        **dict(figures({str(k): item for k, item in enumerate(summary.get("criteria", ()))}, "criteria.")),
        "warnings": BETWEEN.join(map(one_line, result.warnings)) or None,
        "wall": wall,
    }


def figures(summary: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every entry of a summary that is one value; those of nested objects under names with dots, as energy.kinetic."""
    for key, value in summary.items():
        if isinstance(value, Mapping):
            yield from figures(value, f"{prefix}{key}.")
        elif value is None or isinstance(value, str | bool | int | float | np.generic):
            yield prefix + key, plain(value)


@contextmanager
def _silent() -> Iterator[None]:
    """Warnings of runs are in their rows; the log leaves out those of this thread."""
    thread = threading.get_ident()
    _SILENT.add(thread)
    try:
        yield
    finally:
        _SILENT.discard(thread)


_SILENT: set[int] = set()  # threads in which runs of a sweep are going on
logging.getLogger(LOGGER).addFilter(lambda record: record.thread not in _SILENT)
