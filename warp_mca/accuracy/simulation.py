"""Owns `run`: its arguments, and which kind of run they ask for."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from warp_mca.accuracy.plan import Plan, planned, run_planned
from warp_mca.accuracy.request import Accuracy, check_accuracy
from warp_mca.base.errors import GuardError, bad_value
from warp_mca.base.garbage import few_collections
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.arguments import (
    Progress,
    check_recorders,
    check_scene,
    one_at_a_time,
    shows_progress,
    span_of,
    teller,
)
from warp_mca.phases.checkpoint import Checkpoint
from warp_mca.phases.every import METHOD, Every, every_of
from warp_mca.phases.meshing import mesh
from warp_mca.phases.prepare import Clock, Request
from warp_mca.phases.settings import settings_of
from warp_mca.phases.simulate import simulate
from warp_mca.recorders.portrait import Portrait
from warp_mca.recorders.recorder import Recorder
from warp_mca.results.criteria import with_verdict
from warp_mca.results.result import Result
from warp_mca.results.storage import check_output, hold, write
from warp_mca.scene import Scene
from warp_mca.scene.options import with_options

__all__ = ["mesh", "run"]


@one_at_a_time
@shows_progress
@few_collections()
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
    progress: Progress | bool | None = None,
    method: str = "mca",
    checkpoint: str | Every | None = None,
    figures: str = "png",
) -> Result:
    """Run a scene: rigid phase if it has one, hand-off, finite-element impact.

    Runs of several threads wait for each other: Warp captures graphs for the whole process.

    Args:
        scene: what to run.
        device: "cpu", a CUDA device as "cuda:0", or "cuda" for the first of them.
        precision: "mixed" computes elements in float32 around float64 nodes, "float64" all in float64.
        threads: CPU threads to use; None for all cores that this process may use. Results do not depend on it.
        multi_rate: groups of elements with steps of their own; "auto" chooses how many, None: all take one step.
        duration: of the impact phase [s]; the scene's own if None.
        out, figures: folder for summary.json, history.csv and pictures (no PNG with "none"); None: nothing is written.
        force: replace results that `out` holds already.
        refine: how many times smaller the cells of all bodies are than their recipes say, in place of `Scene.refine`.
        mass_scaling: in place of `ImpactPhase.mass_scaling`, with the same values.
        accuracy: greatest error of the first force peak, the impulse and the contact duration, as 0.02 or "2%": mesh,
            step and contact springs are then chosen, but those that are given here (docs/accuracy.md).
        meshes: finished meshes by body, to save making them again.
        recorders: what shows or writes the run while it goes on, see `warp_mca.recorders`.
        progress: called with a stage and the share of it that is done; True shows a bar, or lines if piped.
        method: "mca" swings rigid links; "pure-fem" computes the swing by finite elements too.
        checkpoint: how often `out` gets the state, as `Every.parse` has it, from which the same call goes on.

    Returns:
        The result, with histories as float64 arrays.

    Raises:
        RequestError: the request cannot be carried out; nothing was written.
        GuardError: the run lost its footing (not-a-number, inverted element, energy, lost contact).
    """
    check_scene("scene", scene)
    scene = with_options(scene, refine, mass_scaling, meshes)
    span, settings = span_of(scene, duration), settings_of(device, precision, threads, multi_rate)
    _check_files(recorders, out, force)
    every, shown = _every(method, checkpoint, out, scene, recorders, accuracy), Portrait(recorders, figures)
    request = Request(span=span, settings=settings, tell=teller(progress), recorders=recorders, begun=shown.take)
    typed = {"refine": refine, "mass_scaling": mass_scaling, "multi_rate": multi_rate}
    again = partial(run, device=device, precision=precision, threads=threads, duration=duration)
    plan = planned(scene, accuracy, typed, device, meshes, again)
    return run_planned(plan, partial(_kept, partial(_judged, scene, meshes, method, request), shown, out, force, every))


def _every(
    method: str,
    checkpoint: str | Every | None,
    out: str | os.PathLike[str] | None,
    scene: Scene,
    recorders: Sequence[Recorder],
    accuracy: float | str | Accuracy | None,
) -> Every | None:
    """How often the run stores its state, None for never; arguments as in `run`.

    Raises:
        RequestError: the run cannot store it, or `accuracy` is asked of one that would, or is none of this scene.
    """
    check_accuracy(scene, accuracy)
    every = every_of(method, checkpoint, out, recorders)
    if accuracy is not None and (every or method == METHOD):
        remedy = "it is for runs of one impact that store nothing on the way; leave it out, or method and checkpoint"
        raise bad_value("accuracy", accuracy.percent if isinstance(accuracy, Accuracy) else accuracy, remedy)
    return every


def _kept(
    result: Callable[[Checkpoint | None, Plan | None], Result],
    shown: Portrait,
    out: str | os.PathLike[str] | None,
    force: bool,
    every: Every | None,
    plan: Plan | None,
) -> Result:
    """What came of a run, which holds its folder meanwhile if it writes to one; arguments as in `run`.

    `shown` has the pictures of the report.

    Raises:
        RequestError: the folder cannot be used.
    """
    if out is None:
        return result(None, plan)
    with hold(out, force=force) as folder:
        store = Checkpoint(folder.path, every, force) if every else None
        found = result(store, plan)
        images = partial(shown.images, found.failed)
        found = write(found, folder, force=force, images=images, figures=shown.drawn)
        if store:
            store.remove()
        return found


def _check_files(recorders: Sequence[Recorder], out: str | os.PathLike[str] | None, force: bool) -> None:
    """Refuse what is no recorder, and files that cannot be written.

    Raises:
        RequestError: so it is.
    """
    from warp_mca.recorders.checks import check_files

    check_recorders(recorders)
    check_files(recorders, None if out is None else check_output(out, force=force))


def _judged(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    method: str,
    request: Request,
    store: Checkpoint | None,
    plan: Plan | None,
) -> Result:
    """What came of a request, with the verdict of the scene's criteria; raises as `_result`."""
    return with_verdict(_result(scene, meshes, method, request, store, plan), scene.criteria)


def _result(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    method: str,
    request: Request,
    store: Checkpoint | None,
    plan: Plan | None,
) -> Result:
    """What came of a request, or of what was planned in its place.

    Raises:
        RequestError: the request cannot be carried out.
        GuardError: the run lost its footing, or nothing touched.
    """
    request = replace(request, store=store, clock=Clock())
    if plan is None or method == METHOD:
        return _phases(scene, meshes, method, request)
    if plan.ready is not None and not request.recorders:
        return plan.judged(plan.ready)
    settings = replace(request.settings, **plan.variant.options)
    return plan.judged(_phases(plan.scene, meshes, method, replace(request, settings=settings)))


def _phases(scene: Scene, meshes: Mapping[str, Mesh] | None, method: str, request: Request) -> Result:
    """Finite elements from the release on, swings and impacts in turn, or one impact; raises as `_result`."""
    if method == METHOD:
        from warp_mca.phases.pure_fem import run_pure

        return run_pure(scene, meshes, request)
    if scene.t_end is not None:
        from warp_mca.phases.cycle import Cycle

        return Cycle(scene, meshes, request).run()
    (found,) = simulate([scene], None if meshes is None else [meshes], request)
    if found.stopped is not None:
        raise GuardError(found.stopped)
    return found
