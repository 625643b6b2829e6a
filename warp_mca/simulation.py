"""Owns the only time loop: mesh, swing, hand over, step, record, guard, report."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.elements import ELEMENTS
from warp_mca.errors import bad_value
from warp_mca.geometry.degenerate import tetrahedral
from warp_mca.geometry.mesh import Mesh
from warp_mca.handoff import HandOff, hand_off
from warp_mca.ledger import Ledger
from warp_mca.model import Model, body_materials, build_model, nodal_masses
from warp_mca.paths import locate, path_histories
from warp_mca.recorders.recorder import Recorder, RunInfo
from warp_mca.results import Result, RunFacts, check_output, save, summarise
from warp_mca.scene import Scene

if TYPE_CHECKING:
    from warp_mca.recorders.frames import Recording
    from warp_mca.solver import Solver

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

# Speeds may grow this many times over the initial one before a node can outrun the contact search between two passes.
SPEED_RESERVE = 4.0
COROTATIONAL_STRAIN = 0.1  # beyond this, small strain in a rotated frame is off by a tenth of itself


@dataclass(frozen=True)
class Steps:
    """How an output interval is divided.

    Attributes:
        dt: time step [s].
        per_search: steps between two searches for contact.
        searches: searches in an output interval.
        intervals: output intervals in the run.
    """

    dt: float
    per_search: int
    searches: int
    intervals: int

    @property
    def per_interval(self) -> int:
        """Steps of an output interval."""
        return self.per_search * self.searches

    @property
    def interval(self) -> float:
        """Output interval [s]."""
        return self.dt * self.per_interval

    @property
    def count(self) -> int:
        """Steps of the whole run."""
        return self.per_interval * self.intervals


def mesh(scene: Scene) -> dict[str, Mesh]:
    """The mesh of every body, checked.

    Raises:
        RequestError: an element is inverted, or a recipe or file cannot be turned into a mesh.
    """
    from warp_mca.geometry.quality import check

    meshes = {}
    made: dict[int, Mesh] = {}
    for body in scene.bodies:
        key = id(body.geometry)
        if key not in made:
            made[key] = body.geometry if isinstance(body.geometry, Mesh) else body.geometry.build()
            check(made[key], body.name)
        meshes[body.name] = made[key]
    cut = _cut(scene, meshes)
    for name, item in cut.items():
        if item is not meshes[name]:  # a hexahedron with a folded corner may give an inverted tetrahedron
            check(item, name)
    return cut


def _cut(scene: Scene, meshes: Mapping[str, Mesh]) -> dict[str, Mesh]:
    """The meshes, cut to tetrahedra where a body's formulation takes them."""
    cut = {body.name for body in scene.bodies if ELEMENTS[body.element].corners == 4}
    return {name: tetrahedral(mesh) if name in cut else mesh for name, mesh in meshes.items()}


def divide(scene: Scene, model: Model, duration: float) -> Steps:
    """Choose the time step so that whole steps fill each output interval, and how often to search for contact.

    Raises:
        RequestError: motion in one step would be lost in the rounding of positions.
    """
    impact = scene.impact
    intervals = max(1, round(duration / impact.output_interval))
    interval = duration / intervals
    stable = impact.time_step_scale * model.stable.dt
    speed = float(np.linalg.norm(model.V, axis=1).max())
    spacing = float(np.spacing(np.abs(model.X).max()))
    if 0.0 < speed * stable < 4.0 * spacing:
        raise bad_value(
            "Body.position",
            float(np.abs(model.X).max()),
            f"this far from the origin, positions are rounded to {spacing:.2g} m and a step's motion of "
            f"{speed * stable:.2g} m is lost; move the scene closer to the origin",
        )
    margins = [item.margin for item in model.passes if item.plane is None]
    searches = math.ceil(SPEED_RESERVE * speed * interval / (0.5 * min(margins))) if margins else 1
    searches = max(1, searches)
    per_search = math.ceil(interval / searches / stable)
    return Steps(dt=interval / (searches * per_search), per_search=per_search, searches=searches, intervals=intervals)


@dataclass
class _Clock:
    """Wall-clock seconds by stage."""

    wall: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("rigid", "mesh", "compile", "fe", "output"), 0.0)
    )
    last: float = field(default_factory=time.perf_counter)

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self.wall[stage] += now - self.last
        self.last = now


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
    from warp_mca.output import Output
    from warp_mca.recorders.frames import Recording, skins
    from warp_mca.solver import Solver, check_device
    from warp_mca.threads import thread_count

    tell = progress or (lambda stage, done: None)
    span = scene.impact.duration if duration is None else duration
    if not (math.isfinite(span) and span > 0.0):
        raise bad_value("duration", span, "give a finite time above 0 s")
    check_device(device)
    threads = thread_count(threads)
    if out is not None:
        check_output(out, force=force)
    clock = _Clock()
    tell("mesh", 0.0)
    meshes = mesh(scene) if meshes is None else _cut(scene, meshes)
    clock.lap("mesh")
    tell("rigid", 0.0)
    start = hand_off(scene, meshes, nodal_masses(scene, meshes))
    clock.lap("rigid")
    model = build_model(scene, meshes, start.positions, start.velocities)
    steps = divide(scene, model, span)
    probes = locate(scene, model, meshes)
    clock.lap("mesh")
    tell("compile", 0.0)
    solver = Solver(model, device=device, precision=precision, dt=steps.dt, threads=threads)
    said: list[str] = []
    surfaces = skins(model, meshes) if recorders else {}
    info = RunInfo(scene, model, surfaces, probes.position, steps.dt, steps.interval, span, said.append)
    if recorders or scene.paths:
        solver.output = Output(solver, surfaces, probes, frozenset().union(*(r.needs for r in recorders)))
    solver.compile()
    clock.lap("compile")
    ledger = Ledger(model, steps.dt, steps.interval, scene.impact.energy_tolerance)
    recording = Recording(recorders, info, steps.intervals, steps.per_interval, solver.output)
    solver.start()
    try:
        paths = _advance(solver, steps, ledger, recording, tell)
    except BaseException:
        recording.finish(False)
        raise
    clock.lap("fe")
    recording.finish(True)
    clock.lap("output")
    tell("impact", 1.0)
    facts = _facts(scene, meshes, model, start, steps, ledger, solver, clock)
    history = ledger.history()
    warnings = (*_warnings(scene, start, ledger), *said)
    result = Result(summarise(history, facts), history, None, warnings, path_histories(probes, paths))
    if out is not None:
        result = save(result, out, force=force)
    return result


def _advance(solver: Solver, steps: Steps, ledger: Ledger, recording: Recording, tell: Progress) -> list[NDArray]:
    """Run the finite elements: in each output interval search for contact, record, step. Returns the probes' rings."""
    from warp_mca.solver import ROWS
    from warp_mca.transfer import Transfer

    rings: list[NDArray] = []
    transfer = Transfer(solver.records(), solver.device)

    def read() -> None:
        written, records = transfer.receive()
        first = ledger.count
        ledger.read(written, records)
        if "path_stress" in records:
            rings.append(records["path_stress"][:written].copy())
        recording.history(lambda: ledger.history(first))
        tell("impact", ledger.count / (steps.intervals + 1))

    def record(interval: int, count: int) -> None:
        needs = recording.needs(interval)
        solver.search()
        solver.record_and_step(count, needs)
        recording.take(interval, needs)

    for interval in range(steps.intervals):
        record(interval, steps.per_search)
        for _ in range(steps.searches - 1):
            solver.search()
            solver.step(steps.per_search)
        if (interval + 1) % ROWS == 0:
            if transfer.full:
                read()
            transfer.send(ROWS)
            while transfer.arrived:
                read()
    record(steps.intervals, 1)
    while transfer.pending:
        read()
    transfer.send(steps.intervals % ROWS + 1)
    read()
    return rings


def _facts(
    scene: Scene,
    meshes: Mapping[str, Mesh],
    model: Model,
    start: HandOff,
    steps: Steps,
    ledger: Ledger,
    solver: Solver,
    clock: _Clock,
) -> RunFacts:
    more: dict[str, object] = {
        "energy_drift_rigid": start.energy_drift,
        "handoff_mismatch": {
            "momentum": start.momentum_mismatch,
            "angular_momentum": start.angular_momentum_mismatch,
            "kinetic_energy": start.energy_mismatch,
        },
        "max_penetration": solver.max_penetration(),
        "max_strain": ledger.max_strain,
        "stable_dt": model.stable.dt,
        "joint_impulse": solver.joint_impulses(),
        "threads": solver.threads,
    }
    if scene.paths:
        body = scene.body(scene.paths[0].lines[0].body)
        more["wave_speeds"] = body_materials(body, meshes[body.name])[0][0].wave_speeds
    return RunFacts(
        scene=scene.name,
        n_elements=model.element_count,
        n_nodes=model.node_count,
        dt=steps.dt,
        n_steps=steps.count,
        simulated_time=steps.dt * steps.count,
        wall=clock.wall,
        device=solver.device_name(),
        precision=solver.precision,
        element=" ".join(sorted({block.element for block in model.blocks})),
        energy_error=ledger.energy_error,
        energy=ledger.energy(),
        max_plastic_strain=solver.max_plastic_strain(),
        parameters=scene.parameters,
        t_contact=start.t_contact if scene.rigid else None,
        v_n=start.v_n,
        v_t=start.v_t,
        theta=tuple(float(x) for x in start.theta),
        theta_dot=tuple(float(x) for x in start.theta_dot),
        more=more,
    )


def _warnings(scene: Scene, start: HandOff, ledger: Ledger) -> list[str]:
    found = []
    corotational = any(body.kinematics == "corotational" for body in scene.bodies)
    if corotational and ledger.max_strain > COROTATIONAL_STRAIN:
        found.append(
            f"strain reached {ledger.max_strain:.2f}; the co-rotational element takes strains as small, "
            f"expect stresses off by as much where it exceeds {COROTATIONAL_STRAIN}, or choose kinematics='finite'"
        )
    if scene.rigid and scene.rigid.inertia == "slender":
        found.append(
            f"the rigid phase took slender rods: momentum changes by {start.momentum_mismatch:.1%} and kinetic energy "
            f"by {start.energy_mismatch:.1%} at hand-off; rigid_inertia=mesh keeps both"
        )
    return found
