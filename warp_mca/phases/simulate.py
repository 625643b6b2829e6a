"""Owns the impact phase of scenes side by side, from their meshes to their results: a run is a batch of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from warp_mca.base.errors import RequestError
from warp_mca.base.log import warn
from warp_mca.geometry.mesh import Mesh
from warp_mca.model.paths import Found
from warp_mca.model.precision import check_range
from warp_mca.phases.arguments import Progress
from warp_mca.phases.checkpoint import Checkpoint, damage_explained
from warp_mca.phases.checkpoint import advance as advance_stored
from warp_mca.phases.forecast import announce
from warp_mca.phases.prepare import Clock, Prepared, prepare
from warp_mca.phases.rate_groups import grouping
from warp_mca.phases.settings import Settings
from warp_mca.phases.settle import settle
from warp_mca.phases.stretch import Stretch, restored, rows_before, stored
from warp_mca.recorders.recorder import Recorder, RunInfo
from warp_mca.results.result import Result
from warp_mca.scene import Scene, Settle

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact

DRIVERS = {Settle: settle}  # of phases before the impact


def simulate(
    scenes: Sequence[Scene],
    meshes: Sequence[Mapping[str, Mesh]] | None,
    span: float,
    tell: Progress,
    settings: Settings,
    recorders: Sequence[Recorder] = (),
    store: Checkpoint | None = None,
) -> list[Result]:
    """Run scenes side by side.

    Args:
        scenes: as `run_batch` checks them; a lone one may have `recorders`.
        meshes: finished meshes by body of each scene, or None.
        span: of the impact phase [s].
        tell: told of stages.
        settings: device, precision and threads.
        recorders: of a lone scene.
        store: where a lone scene without recorders stores its state, and goes on from it.

    Returns:
        The result of each scene; where a guard stopped one, `Result.stopped` says so.

    Raises:
        RequestError: the request cannot be carried out.
    """
    from warp_mca.phases.impact import Impact
    from warp_mca.recorders.frames import Recording, skins

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
    if store:
        store.is_for(impact, span, settings, "mca")
    announce(impact)
    stretches = _advance(impact, tell, store)
    clock.lap("fe")
    failed: tuple[str, ...] = ()
    if impact.recording:
        impact.recording.finish(impact.stopped[0] is None)
        failed = tuple(impact.recording.failed)
        clock.lap("output")
    tell("impact", 1.0)
    results = []
    for item, stopped in zip(impact.scene_runs, impact.stopped, strict=True):
        found = item.result(clock.wall, said, stopped, before=rows_before(item, stretches))
        results.append(replace(found, failed=failed))
    return results


def _advance(impact: Impact, tell: Progress, store: Checkpoint | None = None) -> list[Stretch]:
    """The phases before the impact, and this one with its recorders or its checkpoint.

    Returns:
        What comes before the impact.
    """
    passed = 0  # rows that recorders have

    def told() -> None:
        nonlocal passed
        if recording and impact.rows > passed:
            first, passed = passed, impact.rows
            recording.history(lambda: impact.scene_runs[0].history(first))
        tell("impact", impact.rows / (impact.steps.intervals + 1))

    recording, impact.recording = impact.recording, None  # they see the impact
    try:
        kept = store.stored() if store else None
        if store and kept:
            with damage_explained(store.path):
                stretches = restored(*kept[:2])
        else:
            phases = impact.ready[0].scene.phases
            stretches = [_before(phase, impact, lambda done: tell("impact", done)) for phase in phases]
        impact.recording = recording
        if store:
            advance_stored(impact, store, told, before=stored(stretches))
        else:
            impact.advance(told=told)
    except BaseException:
        if recording:
            recording.finish(False)
        raise
    return stretches


def _before(phase: Any, impact: Impact, tell: Callable[[float], None]) -> Stretch:
    """Carry out a phase that comes before the impact: one of `DRIVERS`, or of the user's own, which has `advance`."""
    driver = DRIVERS.get(type(phase))
    return driver(phase, impact, tell) if driver else phase.advance(impact, tell)


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
