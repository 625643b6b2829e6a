"""Owns batches: independent scenes side by side in one model, so that small ones fill a device."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import GuardError, McaError, RequestError, bad_value
from warp_mca.base.folder import held
from warp_mca.geometry.mesh import Mesh
from warp_mca.model.join import join_models, join_probes
from warp_mca.model.layout import offsets
from warp_mca.model.precision import check_range
from warp_mca.results.paths import Found
from warp_mca.results.result import Result
from warp_mca.results.storage import ALL_FILES, check_output, folder_path, save
from warp_mca.runs.account import Account, Prepared
from warp_mca.runs.advice import warn
from warp_mca.runs.arguments import Progress, check_scene, one_at_a_time, span_of, teller
from warp_mca.runs.simulation import Clock, advance, divide_alike, prepare
from warp_mca.scene import RigidPlane, Scene

Meshes = Mapping[str, Mesh]


@one_at_a_time
def run_batch(
    scenes: Iterable[Scene],
    *,
    device: str = "cpu",
    precision: str = "mixed",
    threads: int | None = None,
    duration: float | None = None,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    meshes: Sequence[Meshes] | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """Run independent scenes at once, each with its own parameters: their elements share every launch.

    The scenes take the same steps: the smallest that one of them needs, so that the result of each is that of the scene
    alone with this step. They must have the same duration and output interval, and contacts of the same kinds, in the
    same order; all else may differ. Parts that scenes have in common are meshed once. Runs of several threads wait for
    each other.

    Args:
        scenes: what to run.
        device, precision, threads, force: as in `warp_mca.run`.
        duration: of the impact phase [s]; the scenes' own if None.
        out: folder that gets a folder for each scene, named by its number from 0, with the files of `warp_mca.run`;
            with `force`, results of a larger batch before it are removed.
        meshes: finished meshes by body, for each scene, to save making them again.
        progress: called with a stage and the share of it that is done.

    Returns:
        The result of each scene. Where a guard stopped one, `Result.stopped` says so, its rows end there, and nothing
        of it is written; the others go on. Wall times are those of the batch.

    Raises:
        RequestError: the request cannot be carried out; nothing was written.
    """
    from warp_mca.solve.solver import check_device
    from warp_mca.solve.threads import thread_count

    if isinstance(scenes, str) or not isinstance(scenes, Iterable):
        raise bad_value("scenes", validate.brief(scenes), "give a list of scenes; mca.run runs a single one")
    scenes = list(scenes)
    tell = teller(progress)
    span = check_alike(scenes, duration)
    check_device(device)
    settings: dict[str, Any] = {"device": device, "precision": precision, "threads": thread_count(threads)}
    with hold_scenes(out, len(scenes), force) as folders:
        return save_scenes(_simulate(scenes, meshes, span, tell, **settings), folders, force)


def _simulate(
    scenes: Sequence[Scene],
    meshes: Sequence[Meshes] | None,
    span: float,
    tell: Progress,
    *,
    device: str,
    precision: str,
    threads: int,
) -> list[Result]:
    """The runs themselves, of `span` [s]; arguments are those of `run_batch`, checked."""
    from warp_mca.runs.initial_overlap import settle_initial_overlap
    from warp_mca.solve.output import Output
    from warp_mca.solve.solver import Solver

    clock = Clock()
    ready = _prepare(scenes, meshes, precision, clock, tell)
    warn(sentence for item in ready for sentence in item.warnings)
    steps = divide_alike([(item.scene, item.model) for item in ready], span)
    model, probes = join_models([item.model for item in ready]), join_probes(ready)
    clock.lap("mesh")
    tell("compile", 0.0)
    solver = Solver(model, device=device, precision=precision, dt=steps.dt, threads=threads)
    if len(probes.corner):
        solver.output = Output(solver, {}, probes, frozenset())
    solver.compile()
    settle_initial_overlap(ready, solver)
    clock.lap("compile")
    first = offsets([len(item.probes.corner) for item in ready])
    accounts = [Account(item, steps, solver, k, int(first[k])) for k, item in enumerate(ready)]
    stopped: list[str | None] = [None] * len(scenes)
    solver.start()
    with suppress(GuardError):  # that of the last scene
        advance(solver, steps, _reader(accounts, stopped, steps.intervals + 1, tell))
    clock.lap("fe")
    tell("impact", 1.0)
    return [account.result(solver, clock.wall, stopped=stopped[k]) for k, account in enumerate(accounts)]


def save_scenes(results: Sequence[Result], folders: Sequence[Path | None], force: bool) -> list[Result]:
    """Results, those that no guard stopped written to the folders of `hold_scenes`.

    With `force`, old files go: those of scenes that were stopped now, and of a larger batch's other scenes.

    Raises:
        McaError: as in `save`; or old files cannot be removed.
    """
    written = {folder for folder, result in zip(folders, results, strict=True) if folder and not result.stopped}
    if force:
        own = {folder for folder in folders if folder}
        beside = {path for out in {folder.parent for folder in own} for path in out.glob("[0-9]*")}
        _remove(own - written)
        _remove(path for path in beside - own if _of_batch(path))
    return [
        save(result, folder, force=force) if folder in written else result
        for result, folder in zip(results, folders, strict=True)
    ]


def _of_batch(folder: Path) -> bool:
    """Whether it holds a scene of a batch, under the number that it had there."""
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        return summary["batch"]["scene"] == int(folder.name)
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return False


def _remove(folders: Iterable[Path]) -> None:
    """Remove the files of results from folders, and these if nothing else is in them."""
    for folder in folders:
        try:
            for name in ALL_FILES:
                (folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise McaError(f"old results in {folder} could not be removed: {error.strerror or error}") from error
        with suppress(OSError):  # it is not there, or other files are in it
            folder.rmdir()


def _reader(
    accounts: Sequence[Account], stopped: list[str | None], rows: int, tell: Progress
) -> Callable[[int, Mapping[str, NDArray]], None]:
    """What hands records to each account that no guard has stopped, and notes in `stopped` why one does."""

    def read(written: int, records: Mapping[str, NDArray]) -> None:
        for k, account in enumerate(accounts):
            if stopped[k] is None:
                try:
                    account.read(written, records)
                except GuardError as error:
                    stopped[k] = str(error)
                    if None not in stopped:
                        raise
        tell("impact", max(account.ledger.count for account in accounts) / rows)

    return read


def check_alike(scenes: Sequence[Scene], duration: float | None = None) -> float:
    """The duration [s] of scenes that one batch can run.

    Raises:
        RequestError: there is none, or what the scenes must share differs.
    """
    if not scenes:
        raise bad_value("scenes", [], "give at least one scene")
    for k, scene in enumerate(scenes):
        check_scene(f"scenes[{k}]", scene)
    first = scenes[0]
    span = span_of(first, duration)
    for k, scene in enumerate(scenes[1:], 1):
        for name in ("duration", "output_interval"):
            value, wanted = getattr(scene.impact, name), getattr(first.impact, name)
            alike = math.isclose(value, wanted, rel_tol=1e-9)  # computed from other parameters, they differ by rounding
            if not alike and not (name == "duration" and duration is not None):
                remedy = f"the batch takes its steps together and scenes[0] has {wanted:g}; give all scenes the same"
                raise bad_value(f"scenes[{k}].impact.{name}", value, remedy)
        if len(scene.contacts) != len(first.contacts):
            remedy = f"scenes[0] has {len(first.contacts)}; batch scenes with as many contacts"
            raise bad_value(f"number of scenes[{k}].contacts", len(scene.contacts), remedy)
        for i, (contact, wanted) in enumerate(zip(scene.contacts, first.contacts, strict=True)):
            for name, kind in (("master", _kind), ("two_way", bool)):
                value, other = (kind(getattr(item, name)) for item in (contact, wanted))
                if value != other:
                    remedy = f"that of scenes[0] is {other}; batch scenes with contacts of the same kinds"
                    raise bad_value(f"scenes[{k}].contacts[{i}].{name}", value, remedy)
    return span


def _kind(master: object) -> str:
    return "RigidPlane" if isinstance(master, RigidPlane) else "Surface"


@contextmanager
def hold_scenes(out: str | os.PathLike[str] | None, count: int, force: bool) -> Iterator[list[Path | None]]:
    """A folder for each scene, numbered so that names sort, in the folder `out` that is held meanwhile.

    Raises:
        RequestError: as in `check_output`; or another run holds `out`.
    """
    if out is None:
        yield [None] * count
        return
    path, digits = folder_path("out", out), len(str(count - 1))
    folders: list[Path | None] = [check_output(path / f"{k:0{digits}d}", force=force) for k in range(count)]
    with held(path):
        yield folders


def _prepare(
    scenes: Sequence[Scene], meshes: Sequence[Meshes] | None, precision: str, clock: Clock, tell: Progress
) -> list[Prepared]:
    """Every scene at the start of its impact phase."""
    if meshes is not None:
        validate.kind_of("meshes", meshes, (tuple, list), "give a list with the meshes by body of each scene")
    if meshes is not None and len(meshes) != len(scenes):
        raise bad_value("number of meshes", len(meshes), f"give the meshes of each of the {len(scenes)} scenes")
    made: dict[object, Mesh] = {}
    places: Found = {}
    ready = []
    for k, scene in enumerate(scenes):
        try:
            own = None if meshes is None else meshes[k]
            ready.append(prepare(scene, own, clock, _share(tell, k / len(scenes)), places, made))
            check_range(ready[-1].model, precision)
        except RequestError as error:
            raise RequestError(f"scenes[{k}]: {error}") from error
    return ready


def _share(tell: Progress, done: float) -> Progress:
    """Tells of every stage that this share of the scenes is done with it."""
    return lambda stage, _: tell(stage, done)
