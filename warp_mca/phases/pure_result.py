"""Owns what a run of pure finite elements adds up to: one history of swing and impact, one summary."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from warp_mca.phases.cycle_rows import SPENT, STORED
from warp_mca.phases.every import METHOD
from warp_mca.phases.history_rows import phase_facts
from warp_mca.phases.pure_fem import PureRun
from warp_mca.phases.stretch import Stretch, rows_before
from warp_mca.results.result import Result
from warp_mca.rigid.target import target_plane


def pure_result(run: PureRun) -> Result:
    """What came of a run that is over. Times count from the interval in which a link touched."""
    scene_run, touch = run.impact.scene_runs[0], run.place.touch
    assert touch is not None
    origin = (touch - 1) * run.fine.interval
    swing = Stretch(kind="swing", ended_by="touch", steps=run.coarse, count=run.place.swung, records=run.swing)
    found = scene_run.result(run.clock.wall, before=rows_before(scene_run, [swing], origin), origin=origin)
    return replace(found, summary={**found.summary, **_figures(run, found, origin, touch)})


def _figures(run: PureRun, found: Result, origin: float, touch: int) -> dict[str, Any]:
    """What the summary says otherwise than that of an impact phase.

    Args:
        run: that is over.
        found: result of the rows of the impact.
        origin: time of the touch after the first of them [s].
        touch: row whose interval the touch is in.
    """
    place, t_contact = run.place, run.begin + origin
    steps = place.swung + found.summary["n_steps"]
    rate = found.summary["element_steps_per_s"]
    impulse = {
        name: (np.asarray(total) - place.joint_impulse[name]).tolist()
        for name, total in found.summary["joint_impulse"].items()
    }
    return {
        "method": METHOD,
        "t_contact": t_contact,
        **_approach(run, found, len(run.swing.sums) + touch - 1),
        "theta": [],
        "theta_dot": [],
        "n_steps": steps,
        "simulated_time": steps * run.fine.dt,
        "element_steps_per_s": None if rate is None else rate * steps / found.summary["n_steps"],
        "joint_impulse": impulse,
        "phases": _phases(run, t_contact, touch),
        "configuration": place.configuration,
        "configuration_error": max((error for _, error in place.configuration), default=0.0),
    }


def _phases(run: PureRun, t_contact: float, touch: int) -> list[dict[str, Any]]:
    """The swing until the touch, and the impact."""
    ledger, place = run.impact.scene_runs[0].ledger, run.place
    energies = ledger.energies()
    found = []
    for kind, start, row, ended_by in (("swing", 0.0, touch - 1, "touch"), ("impact", t_contact, -1, "duration")):
        end = run.begin + (len(ledger.kept.sums) - 1 if row < 0 else row) * run.fine.interval
        energy = {key: float(column[row]) for key, column in energies.items() if key in (*STORED, "external_work")}
        energy |= {key: float(energies[key][row]) for key in SPENT}
        wall = place.wall.get(kind, 0.0)
        found.append({**phase_facts(kind, start, end, ended_by, energy), "wall": wall})
    return found


def _approach(run: PureRun, found: Result, row: int) -> dict[str, float]:
    """Velocity of the scene's tip [m/s] before the touch, towards the target and along it, as a hand-off has it."""
    ready = run.impact.ready[0]
    assert ready.scene.rigid is not None
    n = target_plane(ready.scene, ready.scene.rigid.target, ready.meshes).normal
    along = np.array([n[1], -n[0], 0.0]) / np.hypot(n[0], n[1])
    velocity = np.array([found[f"tip_v{axis}"][row] for axis in "xyz"])
    return {"v_n": float(-velocity @ n), "v_t": float(velocity @ along)}
