"""Owns the impact phase of scenes side by side, from their meshes to their results: a run is a batch of one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from warp_mca.base.garbage import few_collections
from warp_mca.geometry.mesh import Mesh
from warp_mca.model.paths import NO_PROBES
from warp_mca.phases.by_helpers import Telling, prepared
from warp_mca.phases.carry_out import Course, begin
from warp_mca.phases.forecast import announce
from warp_mca.phases.prepare import Request
from warp_mca.phases.stretch import rows_before
from warp_mca.recorders.recorder import RunInfo
from warp_mca.results.result import Result
from warp_mca.scene import Scene
from warp_mca.system.reading import read_once


@few_collections()
def simulate(scenes: Sequence[Scene], meshes: Sequence[Mapping[str, Mesh]] | None, request: Request) -> list[Result]:
    """Run scenes side by side.

    Args:
        scenes: as `run_batch` checks them.
        meshes: finished meshes by body of each scene, or None.
        request: how they are run.

    Returns:
        The result of each scene; where a guard stopped one, `Result.stopped` says so.

    Raises:
        RequestError: the request cannot be carried out.
    """
    from warp_mca.recorders.frames import Recording, skins

    recorders, tell, clock = request.recorders, request.tell, request.clock
    ready = prepared(scenes, meshes, request)
    if not request.paths:
        ready = [replace(item, probes=NO_PROBES) for item in ready]
    surfaces = skins(ready[0].model, ready[0].meshes) if recorders else {}
    needs: frozenset[str] = frozenset().union(*(recorder.needs for recorder in recorders))
    impact = begin(ready, request, skins=surfaces, needs=needs)
    said: list[str] = []
    recording, steps, lone = None, impact.steps, ready[0]
    if recorders:
        paths = lone.probes.position
        info = RunInfo(lone.scene, lone.model, surfaces, paths, steps.dt, steps.interval, request.span, said.append)
        recording = Recording(recorders, info, steps.intervals, steps.per_interval, impact.solver.output)
    announce(impact)  # once recorders have begun, which may refuse the run
    passed = 0

    def opening() -> None:  # recorders see the impact
        impact.recording = recording

    def seen() -> None:
        nonlocal passed
        if impact.recording and impact.rows > passed:
            first, passed = passed, impact.rows
            impact.recording.history(lambda: impact.scene_runs[0].history(first))
        tell("impact", impact.rows / (impact.steps.intervals + 1))

    course, done = Course(impact, request, number=request.number), False
    tell("impact", 0.0)
    try:
        course.run(lone.scene.phases, seen, tell=lambda share: tell("impact", share), opening=opening)
        done = True
    finally:
        clock.lap("fe")
        if recording:
            recording.finish(done and impact.stopped[0] is None)
            clock.lap("output")
    failed = tuple(recording.failed) if recording else ()
    tell("impact", 1.0)
    homes = [item.looks.home for item in impact.scene_runs]
    telling, ended = Telling([item.warnings for item in ready], homes, request.settings.threads), dict[int, Result]()
    with read_once():
        impact.look_at_the_end()
        for k in telling.order:
            before = rows_before(impact.scene_runs[k], course.stretches)
            ended[k], finished = impact.scene_runs[k].outcome(clock.wall, impact.stopped[k], before=before)
            telling.take(k, finished)
    return [replace(ended[k], warnings=(*own, *said), failed=failed) for k, own in enumerate(telling.told())]
