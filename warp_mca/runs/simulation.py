"""Owns the only time loop: mesh, swing, hand over, step, record, guard, report."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.elements import ELEMENTS
from warp_mca.geometry.degenerate import cut_to
from warp_mca.geometry.mesh import Mesh
from warp_mca.model.model import Model, build_model, nodal_masses
from warp_mca.model.precision import check_range
from warp_mca.recorders.recorder import Recorder, RunInfo
from warp_mca.results.paths import Found, locate
from warp_mca.results.result import Result
from warp_mca.results.storage import check_output, hold, write
from warp_mca.rigid.handoff import hand_off
from warp_mca.runs.account import Account, Prepared
from warp_mca.runs.advice import mesh_warnings, warn
from warp_mca.runs.arguments import Progress, check_recorders, check_scene, one_at_a_time, span_of, teller
from warp_mca.scene import Body, Scene
from warp_mca.solve.steps import Steps

if TYPE_CHECKING:
    from warp_mca.recorders.frames import Recording
    from warp_mca.solve.solver import Solver

Array = NDArray[np.float64]
Read = Callable[[int, Mapping[str, NDArray]], None]

# Speeds may grow this many times over the initial one before a node can outrun the contact search between two passes.
SPEED_RESERVE = 4.0
MOST_ROWS = 10_000_000  # of a history: some 5 GB
MOST_STEPS = 10_000_000_000  # of a run: more than a week of the smallest model


def mesh(
    scene: Scene, made: dict[object, Mesh] | None = None, given: Mapping[str, Mesh] | None = None
) -> dict[str, Mesh]:
    """The mesh of every body, checked.

    Args:
        scene: whose bodies to mesh.
        made: meshes by recipe, for scenes that share some; those made here are added.
        given: finished meshes by body, in place of the bodies' own geometry.

    Raises:
        RequestError: an element is inverted, a mesh is not whole or not given, or a recipe or file cannot be turned
            into a mesh.
    """
    from warp_mca.geometry.quality import check

    check_scene("scene", scene)
    if given is not None:
        validate.kind_of("meshes", given, Mapping, "give a Mesh for each body by its name, as mca.mesh makes them")
    meshes = {}
    made = {} if made is None else made
    for body in scene.bodies:
        if given is not None and body.name not in given:
            raise bad_value("meshes", list(given), f"give a mesh of body {body.name} too")
        geometry = body.geometry if given is None else given[body.name]
        if given is not None:
            validate.kind_of(f"meshes[{body.name!r}]", geometry, Mesh, "give a finished Mesh, as mca.mesh makes it")
        key = _key(geometry)
        if key not in made:
            made[key] = geometry if isinstance(geometry, Mesh) else _build(body)
            check(made[key], body.name)
        meshes[body.name] = made[key]
    cut = _cut(scene, meshes)
    for name, item in cut.items():
        if item is not meshes[name]:  # a hexahedron with a folded corner may give an inverted tetrahedron
            check(item, name)
    return cut


def _build(body: Body) -> Mesh:
    """The mesh of a recipe, which may be the user's own.

    Raises:
        RequestError: its `build` failed or returned something else than a mesh.
    """
    field, recipe = f"Body {body.name}.geometry", type(body.geometry).__name__
    made = validate.call(field, recipe, "build()", lambda: getattr(body.geometry, "build")())  # noqa: B009
    validate.kind_of(f"{field}.build()", made, Mesh, "return a warp_mca.Mesh")
    return made


def _key(geometry: object) -> object:
    """What equal recipes share; a mesh, and a recipe that cannot be hashed, is like itself alone."""
    try:
        hash(geometry)
    except TypeError:
        return id(geometry)
    return geometry


def _cut(scene: Scene, meshes: Mapping[str, Mesh]) -> dict[str, Mesh]:
    """The meshes, cut to the cell type of each body's element where that is possible."""
    return {body.name: cut_to(meshes[body.name], ELEMENTS[body.element].cell) for body in scene.bodies}


def divide(scene: Scene, model: Model, duration: float) -> Steps:
    """Choose the time step so that whole steps fill each output interval, and how often to search for contact.

    Raises:
        RequestError: motion in one step would be lost in the rounding of positions, or the history would have too many
            rows, or the run too many steps.
    """
    return divide_alike([(scene, model)], duration)


def divide_alike(parts: Sequence[tuple[Scene, Model]], duration: float) -> Steps:
    """The steps of scenes that share them, as `divide` chooses them: the smallest of their steps, the most searches.

    Raises:
        RequestError: as in `divide`.
    """
    wanted = duration / parts[0][0].impact.output_interval
    if not wanted < MOST_ROWS:
        remedy = f"in {duration:g} s that gives {wanted:.3g} rows, a history holds {MOST_ROWS:,}; give a larger one"
        raise bad_value("ImpactPhase.output_interval", parts[0][0].impact.output_interval, remedy)
    intervals = max(1, round(wanted))
    interval = duration / intervals
    limits = [_limits(scene, model, interval, intervals) for scene, model in parts]
    stable, searches = min(limit[0] for limit in limits), max(limit[1] for limit in limits)
    per_search = math.ceil(interval / searches / stable)
    return Steps(dt=interval / (searches * per_search), per_search=per_search, searches=searches, intervals=intervals)


def _limits(scene: Scene, model: Model, interval: float, intervals: int) -> tuple[float, int]:
    """Longest step [s] of a scene, and how often it must search for contact in an output interval [s].

    Raises:
        RequestError: as in `divide`.
    """
    stable = scene.impact.time_step_scale * model.stable.dt
    if not interval * intervals <= MOST_STEPS * stable:
        (body, element), share = model.owner(model.stable.element), model.stable.contact_share
        raise bad_value(
            "time step [s]",
            float(stable),
            f"{interval * intervals:g} s would take more than {MOST_STEPS:.0e} of them; it is time_step_scale = "
            f"{scene.impact.time_step_scale:g} of what element {element} of body {body} allows, {share:.0%} of it by "
            "contact springs; raise time_step_scale, enlarge that element, lower penalty or duration",
        )
    with np.errstate(over="ignore"):
        speed = float(np.linalg.norm(model.V, axis=1).max())
    driven = max((float(np.abs(drive.velocities).max()) for drive in scene.prescribed), default=0.0)
    fastest = max(speed, driven) + float(np.linalg.norm(scene.gravity)) * interval * intervals
    far = float(np.abs(model.X).max())
    spacing = float(np.spacing(far))
    if 0.0 < speed * stable < 4.0 * spacing:
        lost = f"positions are rounded to {spacing:.2g} m and a step's motion of {speed * stable:.2g} m is lost"
        if far < 2.0 * float(np.ptp(model.X, axis=0).max()):  # nearer to the origin it would be no better
            raise bad_value("speed of the bodies", speed, f"{lost}; give a greater one, or start at rest")
        raise bad_value("Body.position", far, f"this far from the origin, {lost}; move the scene closer to the origin")
    with np.errstate(over="ignore"):
        apart = float(np.ptp(model.V, axis=0).max()) * stable
    if apart > float(np.ptp(model.X, axis=0).max()):
        remedy = f"in a step some nodes would move {apart:.3g} m more than others; check the unit [m/s or rad/s]"
        raise bad_value("speed of the bodies", speed, remedy)
    margins = [item.margin for item in model.passes if item.plane is None]
    searches = SPEED_RESERVE * fastest * interval / (0.5 * min(margins)) if margins else 1.0
    if not searches * intervals <= MOST_STEPS:
        remedy = f"so fast, a run would search for contact more than {MOST_STEPS:.0e} times; check the unit [m/s]"
        raise bad_value("speed of the bodies", max(float(np.abs(model.V).max()), driven), remedy)
    return stable, max(1, math.ceil(searches))


@dataclass
class Clock:
    """Wall-clock seconds by stage, `wall`, and when the `last` one ended."""

    wall: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("rigid", "mesh", "compile", "fe", "output"), 0.0)
    )
    last: float = field(default_factory=time.perf_counter)

    def lap(self, stage: str) -> None:
        """Count the time since the last lap to a stage."""
        now = time.perf_counter()
        self.wall[stage] += now - self.last
        self.last = now


@one_at_a_time
def run(
    scene: Scene,
    *,
    device: str = "cpu",
    precision: str = "mixed",
    threads: int | None = None,
    duration: float | None = None,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
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
        duration: of the impact phase [s]; the scene's own if None.
        out: folder for summary.json, history.csv and the figures; nothing is written if None.
        force: replace results that `out` holds already.
        meshes: finished meshes by body, to save making them again.
        recorders: what shows or writes the run while it goes on, see `warp_mca.recorders`.
        progress: called with a stage and the share of it that is done.

    Returns:
        The result, with histories as float64 arrays.

    Raises:
        RequestError: the request cannot be carried out; nothing was written.
        GuardError: the run lost its footing (not-a-number, inverted element, energy, lost contact).
    """
    from warp_mca.recorders.frames import check_files
    from warp_mca.solve.solver import check_device
    from warp_mca.solve.threads import thread_count

    check_scene("scene", scene)
    tell = teller(progress)
    span = span_of(scene, duration)
    check_recorders(recorders)
    check_device(device)
    settings: dict[str, Any] = {"device": device, "precision": precision, "threads": thread_count(threads)}
    check_files(recorders, None if out is None else check_output(out, force=force))
    if out is None:
        return _simulate(scene, meshes, recorders, span, tell, **settings)
    with hold(out, force=force) as folder:
        return write(_simulate(scene, meshes, recorders, span, tell, **settings), folder, force=force)


def _simulate(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    recorders: Sequence[Recorder],
    span: float,
    tell: Progress,
    *,
    device: str,
    precision: str,
    threads: int,
) -> Result:
    """The run itself, of `span` [s]; arguments are those of `run`, checked."""
    from warp_mca.recorders.frames import Recording, skins
    from warp_mca.runs.initial_overlap import settle_initial_overlap
    from warp_mca.solve.output import Output
    from warp_mca.solve.solver import Solver

    clock = Clock()
    ready = prepare(scene, meshes, clock, tell)
    check_range(ready.model, precision)
    warn(ready.warnings)
    steps = divide(scene, ready.model, span)
    tell("compile", 0.0)
    solver = Solver(ready.model, device=device, precision=precision, dt=steps.dt, threads=threads)
    said: list[str] = []
    surfaces = skins(ready.model, ready.meshes) if recorders else {}
    paths = ready.probes.position
    info = RunInfo(scene, ready.model, surfaces, paths, steps.dt, steps.interval, span, said.append)
    if recorders or scene.paths:
        solver.output = Output(solver, surfaces, ready.probes, frozenset().union(*(r.needs for r in recorders)))
    solver.compile()
    settle_initial_overlap([ready], solver)
    clock.lap("compile")
    account = Account(ready, steps, solver)
    recording = Recording(recorders, info, steps.intervals, steps.per_interval, solver.output)
    solver.start()

    def read(written: int, records: Mapping[str, NDArray]) -> None:
        first = account.ledger.count
        account.read(written, records)
        if account.ledger.count > first:
            recording.history(lambda: account.ledger.history(first))
        tell("impact", account.ledger.count / (steps.intervals + 1))

    try:
        advance(solver, steps, read, recording)
    except BaseException:
        recording.finish(False)
        raise
    clock.lap("fe")
    recording.finish(True)
    clock.lap("output")
    tell("impact", 1.0)
    return replace(account.result(solver, clock.wall, said), failed=tuple(recording.failed))


def prepare(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    clock: Clock,
    tell: Progress,
    found: Found | None = None,
    made: dict[object, Mesh] | None = None,
) -> Prepared:
    """Mesh a scene, unless its `meshes` are given, run its rigid phase and assemble its model.

    `found` as in `locate`, `made` as in `mesh`.

    Raises:
        RequestError: the scene cannot be built as written.
    """
    tell("mesh", 0.0)
    meshes = mesh(scene, made, meshes)
    clock.lap("mesh")
    tell("rigid", 0.0)
    start = hand_off(scene, meshes, nodal_masses(scene, meshes) if scene.rigid else {})
    clock.lap("rigid")
    model = build_model(scene, meshes, start.positions, start.velocities)
    probes = locate(scene, model, meshes, found)
    clock.lap("mesh")
    return Prepared(scene, meshes, start, model, probes, tuple(mesh_warnings(scene, meshes, model)))


def advance(solver: Solver, steps: Steps, read: Read, recording: Recording | None = None) -> None:
    """Run the finite elements: search for contact, record, step.

    `read` gets the number of records that were written since its last call, and `Solver.records` with these first.
    """
    from warp_mca.solve.solver import ROWS
    from warp_mca.solve.transfer import Transfer

    transfer = Transfer(solver.records(), solver.device)
    written = 0

    def record(count: int, row: int | None) -> None:
        """Record and step; `row` is the number of the row of the history that the record gives, if it gives one."""
        nonlocal written
        needs: frozenset[str] = recording.needs(row) if recording and row is not None else frozenset()
        solver.record_and_step(count, needs, row is not None)
        written += 1
        if recording and row is not None:
            recording.take(row, needs)

    def send() -> None:
        nonlocal written
        if transfer.full:
            read(*transfer.receive())
        transfer.send(written)
        written = 0
        while transfer.arrived:
            read(*transfer.receive())

    for interval in range(steps.intervals):
        for number, part in enumerate(steps.parts()):
            if part.begins_check and written == ROWS:
                send()
            if part.begins_search:
                solver.search()
            if part.begins_check:
                record(part.count, interval if number == 0 else None)
            else:
                solver.step(part.count)
    if written == ROWS:
        send()
    solver.search()
    record(1, steps.intervals)
    while transfer.pending:
        read(*transfer.receive())
    transfer.send(written)
    read(*transfer.receive())
