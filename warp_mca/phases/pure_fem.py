"""Owns runs of pure finite elements: the flexible model from the release on, its swing included."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from warp_mca.base.errors import bad_value
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.carry_out import Course, begin
from warp_mca.phases.cycle_rows import SPENT, STORED
from warp_mca.phases.every import METHOD
from warp_mca.phases.flexible_swing import FlexibleSwing
from warp_mca.phases.forecast import announce
from warp_mca.phases.history_rows import phase_facts
from warp_mca.phases.prepare import Request, place
from warp_mca.phases.stretch import rows_before
from warp_mca.results.result import Result
from warp_mca.rigid.handoff import at_release, speeds
from warp_mca.rigid.target import target_plane
from warp_mca.scene import Scene

LEDGER = (*STORED, *SPENT, "external_work")


def run_pure(scene: Scene, meshes: Mapping[str, Mesh] | None, request: Request) -> Result:
    """Swing and impact of a scene with a rigid phase. Times count from the interval in which a link touched.

    Raises:
        RequestError: the request cannot be carried out, or the folder holds the state of another one.
        GuardError: the run lost its footing, or nothing touched.
    """
    _check(scene)
    setup = place(scene, meshes, request, by=at_release)
    ready = setup.ready(setup.start.positions, setup.start.velocities)
    swing = FlexibleSwing(ready, request.span)
    impact = begin([ready], request, swing.span)
    announce(impact)
    course = Course(impact, request, METHOD)
    swing.carried_out_by(course)
    whole = swing.predicted + request.span

    def tell(t: float) -> None:
        request.tell("impact", min(1.0, t / whole))

    def told() -> None:
        tell(swing.predicted + impact.rows * swing.fine.interval)

    course.run([swing], told, tell=tell, opening=swing.look_closely)
    swing.check(course.stretches[0].count)
    request.clock.lap("fe")
    request.tell("impact", 1.0)
    return _result(course, swing)


def _check(scene: Scene) -> None:
    """Refuse scenes that cannot be run from their release by finite elements alone.

    Raises:
        RequestError: so it is.
    """
    if scene.rigid is None:
        remedy = "without a rigid phase bodies start where they are, by finite elements; leave it out"
        raise bad_value("method", METHOD, remedy)
    if scene.t_end is not None:
        raise bad_value("Scene.t_end", scene.t_end, f"{METHOD} ends duration after the first touch; leave t_end out")
    if scene.failing:
        remedy = "its elements fail in the impact alone; take method mca, or leave the failure of its material out"
        raise bad_value("method", METHOD, f"body {scene.failing[0]} may fail: {remedy}")
    if scene.prescribed:
        remedy = f"times of a Prescribed velocity count from the touch, which {METHOD} does not know; leave it out"
        raise bad_value("Scene.prescribed", scene.prescribed[0].body, remedy)
    for load in scene.loads:
        if load.counts_from_impact:
            remedy = f"its times count from the touch, which {METHOD} does not know; leave the load out"
            raise bad_value(f"{load.title}.amplitude", getattr(load, "amplitude", None), remedy)


def _result(course: Course, swing: FlexibleSwing) -> Result:
    """What came of a run that is over."""
    scene_run, (stretch,), wall = course.impact.scene_runs[0], course.stretches, course.clock.wall
    touch, fine = swing.first_touch(course.impact.rows), swing.fine
    assert touch is not None
    origin = (touch - 1) * fine.interval
    begin, t_contact = stretch.count * fine.dt, stretch.count * fine.dt + origin
    found = scene_run.result(wall, before=rows_before(scene_run, [stretch], origin), origin=origin)
    summary = found.summary
    steps, rate = stretch.count + summary["n_steps"], summary["element_steps_per_s"]
    impulses, last = stretch.more["joint_impulse"], stretch.records.count + touch - 1
    scene = scene_run.ready.scene
    assert scene.rigid is not None
    plane = target_plane(scene, scene.rigid.target, scene_run.ready.meshes)
    ends = (("swing", 0.0, touch - 1, "touch"), ("impact", t_contact, scene_run.ledger.kept.count - 1, "duration"))
    energies = {key: column for key, column in scene_run.ledger.energies().items() if key in LEDGER}
    phases = []
    for kind, start, row, ended_by in ends:
        energy = {key: float(column[row]) for key, column in energies.items()}
        facts = phase_facts(kind, start, begin + row * fine.interval, ended_by, energy)
        own_wall = stretch.more["wall"] if kind == "swing" else wall["fe"] - stretch.more["wall"]
        phases.append({**facts, "wall": own_wall})
    figures: dict[str, Any] = {
        "method": METHOD,
        "t_contact": t_contact,
        **speeds(np.array([found[f"tip_v{axis}"][last] for axis in "xyz"]), plane),
        "theta": [],
        "theta_dot": [],
        "n_steps": steps,
        "simulated_time": steps * fine.dt,
        "element_steps_per_s": None if rate is None else rate * steps / summary["n_steps"],
        "joint_impulse": {n: (np.array(j) - impulses[n]).tolist() for n, j in summary["joint_impulse"].items()},
        "phases": phases,
        "configuration": stretch.more["configuration"],
        "configuration_error": max((error for _, error in stretch.more["configuration"]), default=0.0),
    }
    return replace(found, summary={**summary, **figures})
