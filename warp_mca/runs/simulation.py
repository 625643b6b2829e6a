"""Owns `run`, and what it shares with batches: a run is a batch of one."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from warp_mca.accuracy.plan import Plan, planned
from warp_mca.accuracy.request import Accuracy
from warp_mca.base.errors import GuardError, RequestError, bad_value
from warp_mca.geometry.mesh import Mesh
from warp_mca.model.precision import check_range
from warp_mca.recorders.recorder import Recorder, RunInfo
from warp_mca.results.paths import Found
from warp_mca.results.result import Result
from warp_mca.results.storage import check_output, hold, write
from warp_mca.runs.advice import warn
from warp_mca.runs.arguments import (
    Progress,
    check_recorders,
    check_scene,
    one_at_a_time,
    span_of,
    teller,
)
from warp_mca.runs.meshing import mesh
from warp_mca.runs.prepare import Clock, Prepared, prepare
from warp_mca.runs.rate_groups import grouping
from warp_mca.runs.settings import Settings, settings_of
from warp_mca.scene import Scene
from warp_mca.scene.options import with_options

if TYPE_CHECKING:
    from warp_mca.runs.impact import Impact

__all__ = ["mesh", "run", "simulate"]


@one_at_a_time
def run(
    scene: Scene,
    *,
    device: str = "cpu",
    precision: str = "mixed",
    threads: int | None = None,
    multi_rate: int | str | None = None,
    duration: float | None = None,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    refine: float | None = None,
    mass_scaling: float | str | None = None,
    accuracy: float | str | Accuracy | None = None,
    meshes: Mapping[str, Mesh] | None = None,
    recorders: Sequence[Recorder] = (),
    progress: Progress | None = None,
) -> Result:
    """Run a scene: rigid phase if it has one, hand-off, finite-element impact.

    Runs of several threads wait for each other: Warp captures graphs for the whole process.

    Args:
        scene: what to run.
        device: "cpu" or a CUDA device as "cuda:0".
        precision: "mixed" computes elements in float32 around float64 nodes, "float64" all in float64.
        threads: of a run on the CPU, all cores that this process may use if None; results do not depend on it.
        multi_rate: number of groups of elements that take steps of their own, 2, 4, 8, ... times that of the smallest;
            "auto" chooses it for the device, None lets all elements take the same step.
        duration: of the impact phase [s]; the scene's own if None.
        out: folder for summary.json, history.csv and the figures; nothing is written if None.
        force: replace results that `out` holds already.
        refine: how many times smaller the cells of all bodies are than their recipes say, in place of `Scene.refine`.
        mass_scaling: in place of `ImpactPhase.mass_scaling`: how many times longer the stable step is to be, or that
            step as "2e-8s", by added mass.
        accuracy: greatest error of the first force peak, the impulse and the contact duration, as 0.02 or "2%": mesh,
            step and contact springs are then chosen, but those that are given here (docs/accuracy.md).
        meshes: finished meshes by body, to save making them again.
        recorders: what shows or writes the run while it goes on, see `warp_mca.recorders`.
        progress: called with a stage and the share of it that is done.

    Returns:
        The result, with histories as float64 arrays.

    Raises:
        RequestError: the request cannot be carried out; nothing was written.
        GuardError: the run lost its footing (not-a-number, inverted element, energy, lost contact).
    """
    check_scene("scene", scene)
    scene = with_options(scene, refine, mass_scaling, meshes)
    tell, span = teller(progress), span_of(scene, duration)
    settings = settings_of(device, precision, threads, multi_rate)
    _check_files(recorders, out, force)
    typed = {"refine": refine, "mass_scaling": mass_scaling, "multi_rate": multi_rate}
    again = partial(run, device=device, precision=precision, threads=threads, duration=duration)
    plan = planned(scene, accuracy, typed, device, meshes, again)
    result = partial(_result, plan, scene, meshes, span, tell, settings, recorders)
    if out is None:
        return result()
    with hold(out, force=force) as folder:
        return write(result(), folder, force=force)


def _check_files(recorders: Sequence[Recorder], out: str | os.PathLike[str] | None, force: bool) -> None:
    """Refuse what is no recorder, and files that cannot be written.

    Raises:
        RequestError: so it is.
    """
    from warp_mca.recorders.frames import check_files

    check_recorders(recorders)
    check_files(recorders, None if out is None else check_output(out, force=force))


def _result(
    plan: Plan | None,
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    span: float,
    tell: Progress,
    settings: Settings,
    recorders: Sequence[Recorder],
) -> Result:
    """One impact, or many in turn, of the scene or what was planned in its place; arguments as in `simulate`.

    Raises:
        RequestError: the request cannot be carried out.
        GuardError: the run lost its footing.
    """
    if plan is None:
        return _single(scene, meshes, span, tell, settings, recorders)
    settings = replace(settings, **plan.variant.options)
    ready = None if recorders else plan.ready
    return plan.judged(ready or _single(plan.scene, meshes, span, tell, settings, recorders))


def _single(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    span: float,
    tell: Progress,
    settings: Settings,
    recorders: Sequence[Recorder],
) -> Result:
    """One impact, or many in turn; arguments as in `simulate`.

    Raises:
        RequestError: the request cannot be carried out.
        GuardError: the run lost its footing.
    """
    if scene.t_end is not None:
        return _cycle(scene, meshes, span, tell, settings, recorders)
    (found,) = simulate([scene], None if meshes is None else [meshes], span, tell, settings, recorders)
    if found.stopped is not None:
        raise GuardError(found.stopped)
    return found


def _cycle(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    span: float,
    tell: Progress,
    settings: Settings,
    recorders: Sequence[Recorder],
) -> Result:
    """Swings and impacts in turn until `Scene.t_end`; arguments as in `simulate`.

    Raises:
        RequestError: the request cannot be carried out.
        GuardError: an impact lost its footing.
    """
    from warp_mca.runs.cycle import begin_cycle, run_cycle
    from warp_mca.runs.cycle_result import cycle_result

    if recorders:
        remedy = "recorders show a single impact; leave t_end out, or the recorders"
        raise bad_value("Scene.t_end", scene.t_end, remedy)
    setup = begin_cycle(scene, meshes, span, settings, tell)
    return cycle_result(setup, run_cycle(setup))


def simulate(
    scenes: Sequence[Scene],
    meshes: Sequence[Mapping[str, Mesh]] | None,
    span: float,
    tell: Progress,
    settings: Settings,
    recorders: Sequence[Recorder] = (),
) -> list[Result]:
    """Run scenes side by side.

    Args:
        scenes: as `run_batch` checks them; a lone one may have `recorders`.
        meshes: finished meshes by body of each scene, or None.
        span: of the impact phase [s].
        tell: told of stages.
        settings: device, precision and threads.
        recorders: of a lone scene.

    Returns:
        The result of each scene; where a guard stopped one, `Result.stopped` says so.

    Raises:
        RequestError: the request cannot be carried out.
    """
    from warp_mca.recorders.frames import Recording, skins
    from warp_mca.runs.impact import Impact

    clock = Clock()
    ready = _prepare(scenes, meshes, span, settings, clock, tell)
    warn(sentence for item in ready for sentence in item.warnings)
    tell("compile", 0.0)
    surfaces = skins(ready[0].model, ready[0].meshes) if recorders else {}
    needs: frozenset[str] = frozenset().union(*(recorder.needs for recorder in recorders))
    impact = Impact(ready, span, **settings.solver, skins=surfaces, needs=needs)
    clock.lap("compile")
    said: list[str] = []
    steps, first = impact.steps, ready[0]
    if recorders:
        paths = first.probes.position
        info = RunInfo(first.scene, first.model, surfaces, paths, steps.dt, steps.interval, span, said.append)
        impact.recording = Recording(recorders, info, steps.intervals, steps.per_interval, impact.solver.output)
    _advance(impact, tell)
    clock.lap("fe")
    failed: tuple[str, ...] = ()
    if impact.recording:
        impact.recording.finish(impact.stopped[0] is None)
        failed = tuple(impact.recording.failed)
        clock.lap("output")
    tell("impact", 1.0)
    results = [
        item.result(clock.wall, said, stopped) for item, stopped in zip(impact.scene_runs, impact.stopped, strict=True)
    ]
    return [replace(result, failed=failed) for result in results]


def _advance(impact: Impact, tell: Progress) -> None:
    """The impact phase, with its recorders."""
    passed = 0  # rows that recorders have

    def told() -> None:
        nonlocal passed
        if impact.recording and impact.rows > passed:
            first, passed = passed, impact.rows
            impact.recording.history(lambda: impact.scene_runs[0].history(first))
        tell("impact", impact.rows / (impact.steps.intervals + 1))

    try:
        impact.advance(told=told)
    except BaseException:
        if impact.recording:
            impact.recording.finish(False)
        raise


def _prepare(
    scenes: Sequence[Scene],
    meshes: Sequence[Mapping[str, Mesh]] | None,
    span: float,
    settings: Settings,
    clock: Clock,
    tell: Progress,
) -> list[Prepared]:
    """Every scene at the start of its impact phase."""
    made: dict[object, Mesh] = {}
    places: Found = {}
    ready = []
    for k, scene in enumerate(scenes):
        try:
            own = None if meshes is None else meshes[k]
            groups = grouping(scene, span, settings.device, settings.multi_rate)
            ready.append(prepare(scene, own, clock, _share(tell, k / len(scenes)), places, made, groups))
            check_range(ready[-1].model, settings.precision)
        except RequestError as error:
            if len(scenes) == 1:
                raise
            raise RequestError(f"scenes[{k}]: {error}") from error
    return ready


def _share(tell: Progress, done: float) -> Progress:
    """Tells of every stage that this share of the scenes is done with it."""
    return lambda stage, _: tell(stage, done)
