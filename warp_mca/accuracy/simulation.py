"""Owns `run`: its arguments, and which kind of run they ask for."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
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
    span_of,
    teller,
)
from warp_mca.phases.checkpoint import Checkpoint
from warp_mca.phases.every import METHOD, Every, every_of
from warp_mca.phases.meshing import mesh
from warp_mca.phases.progress import shows_progress
from warp_mca.phases.settings import Settings, settings_of
from warp_mca.phases.simulate import simulate
from warp_mca.recorders.recorder import Recorder
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
) -> Result:
    """Run a scene: rigid phase if it has one, hand-off, finite-element impact.

    Runs of several threads wait for each other: Warp captures graphs for the whole process.

    Args:
        scene: what to run.
        device: "cpu" or a CUDA device as "cuda:0".
        precision: "mixed" computes elements in float32 around float64 nodes, "float64" all in float64.
        threads: CPU threads to use; None for all cores that this process may use. Results do not depend on it.
        multi_rate: groups of elements with steps of their own; "auto" chooses how many, None: all take one step.
        duration: of the impact phase [s]; the scene's own if None.
        out: folder for summary.json, history.csv and the figures; nothing is written if None.
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
    tell, span = teller(progress), span_of(scene, duration)
    settings = settings_of(device, precision, threads, multi_rate)
    _check_files(recorders, out, force)
    every = _every(method, checkpoint, out, scene, recorders, accuracy)
    typed = {"refine": refine, "mass_scaling": mass_scaling, "multi_rate": multi_rate}
    again = partial(run, device=device, precision=precision, threads=threads, duration=duration)
    plan = planned(scene, accuracy, typed, device, meshes, again)
    request = partial(_result, _Request(scene, meshes, span, tell, settings, recorders, method))
    return run_planned(plan, partial(_carry_out, request, out, force, every))


def _carry_out(
    request: Callable[[Plan | None, Checkpoint | None], Result],
    out: str | os.PathLike[str] | None,
    force: bool,
    every: Every | None,
    plan: Plan | None,
) -> Result:
    """What came of a run, kept in a folder if it has one; arguments as in `run`."""

    def result(store: Checkpoint | None) -> Result:
        return request(plan, store)

    return result(None) if out is None else _kept(result, out, force, every)


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
    result: Callable[[Checkpoint | None], Result], out: str | os.PathLike[str], force: bool, every: Every | None
) -> Result:
    """What came of a run that writes to a folder, which it holds meanwhile; arguments as in `run`.

    Raises:
        RequestError: the folder cannot be used.
    """
    with hold(out, force=force) as folder:
        store = Checkpoint(folder.path, every, force) if every else None
        found = write(result(store), folder, force=force)
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


@dataclass(frozen=True)
class _Request:
    """What is run, and how; fields as in `simulate`."""

    scene: Scene
    meshes: Mapping[str, Mesh] | None
    span: float
    tell: Progress
    settings: Settings
    recorders: Sequence[Recorder]
    method: str


def _result(request: _Request, plan: Plan | None, store: Checkpoint | None) -> Result:
    """What came of a request, or of what was planned in its place.

    Raises:
        RequestError: the request cannot be carried out.
        GuardError: the run lost its footing, or nothing touched.
    """
    if plan is None or request.method == METHOD:
        return _phases(request, store)
    settings = replace(request.settings, **plan.variant.options)
    ready = None if request.recorders else plan.ready
    return plan.judged(ready or _phases(replace(request, scene=plan.scene, settings=settings)))


def _phases(request: _Request, store: Checkpoint | None = None) -> Result:
    """Finite elements from the release on, swings and impacts in turn, or one impact; raises as `_result`."""
    scene, meshes, span, tell, settings, recorders, method = vars(request).values()
    if method == METHOD:
        from warp_mca.phases.pure_fem import PureRun
        from warp_mca.phases.pure_result import pure_result

        run = PureRun(scene, meshes, span, settings, tell)
        run.run(store)
        tell("impact", 1.0)
        return pure_result(run)
    if scene.t_end is not None:
        from warp_mca.phases.cycle import Cycle, begin_cycle

        return Cycle(begin_cycle(scene, meshes, span, settings, tell), store, recorders).run()
    (found,) = simulate([scene], None if meshes is None else [meshes], span, tell, settings, recorders, store)
    if found.stopped is not None:
        raise GuardError(found.stopped)
    return found
