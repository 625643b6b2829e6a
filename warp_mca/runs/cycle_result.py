"""Owns what a cycle of phases adds up to: one history, one ledger, one summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.results.contact_history import ContactHistory, contact_names
from warp_mca.results.paths import PathHistory
from warp_mca.results.result import HISTORY_COLUMNS, Result, RunFacts, summarise
from warp_mca.rigid.placement import link_placements
from warp_mca.runs.cycle import Cycle, ImpactPart, Part, SwingPart

Array = NDArray[np.float64]
Columns = dict[str, Array]

MORE_COLUMNS = ("tip_vz", "plate_vy", "plate_vz", "closing_speed")
NOTHING = "no phase of the run touched anything: give a later t_end, or check positions and speeds"


@dataclass
class Totals:
    """Energies that add up over the phases [J].

    Attributes:
        initial: kinetic energy at the release.
        external_work: of gravity, moving planes, driven nodes, joint torques and a moving base.
        friction: heat of contacts.
        contact_loss: what springs lost as they became softer.
        joint: heat of friction in joints.
        lost: energy of vibration that the ways back to rigid bodies left out.
        hand_off: kinetic energy that other inertia gave where nodes took over from rigid links, and back.
    """

    initial: float = 0.0
    external_work: float = 0.0
    friction: float = 0.0
    contact_loss: float = 0.0
    joint: float = 0.0
    lost: float = 0.0
    hand_off: float = 0.0

    def error(self, stored: Array | float) -> Any:
        """What the energies of bodies and contacts leave unexplained [J]."""
        spent = self.friction + self.contact_loss + self.joint + self.lost
        return stored + spent - self.external_work - self.hand_off - self.initial


@dataclass
class Story:
    """The phases of a run, one after the other.

    Attributes:
        rows: columns of the history of each phase.
        phases: what `summary.json` says of each.
        totals: so far.
        error: greatest energy that was not explained [J].
        scale: greatest initial energy and external work so far [J].
    """

    rows: list[Columns] = field(default_factory=list)
    phases: list[dict[str, Any]] = field(default_factory=list)
    totals: Totals = field(default_factory=Totals)
    error: float = 0.0
    scale: float = 0.0

    def add(self, rows: Columns, phase: dict[str, Any]) -> None:
        """Take in a phase."""
        self.rows.append(rows)
        self.phases.append(phase)
        self.error = max(self.error, float(np.abs(rows["E_total_error"]).max(initial=0.0)))
        self.scale = max(self.scale, abs(self.totals.initial) + abs(self.totals.external_work))


def cycle_result(cycle: Cycle) -> Result:
    """What came of a cycle that is over."""
    story = _story(cycle)
    impacts = [part for part in cycle.parts if isinstance(part, ImpactPart)]
    wall = cycle.clock.wall
    results = [part.impact.accounts[0].result(wall) for part in impacts]
    t_contact = impacts[0].start if impacts else 0.0
    names = list(dict.fromkeys(name for rows in story.rows for name in rows))
    history = {name: np.concatenate([rows[name] for rows in story.rows]) for name in names}
    history = {"time_s": history.pop("t") - t_contact, **history}
    contacts = _contacts(cycle, results, story)
    warnings = [NOTHING] if not impacts else []
    for k, result in enumerate(results, 1):
        warnings += [w if len(results) == 1 else f"impact {k}: {w}" for w in result.warnings]
    stopped = [part.stopped for part in cycle.parts if isinstance(part, SwingPart) and part.stopped]
    summary = results[0].summary if results else _without_impact(cycle, history)
    summary = {**summary, **_of_all(cycle, story, results, contacts, t_contact)}
    return Result(summary, history, None, (*warnings, *stopped), _paths(results, story), contacts=contacts)


def _story(cycle: Cycle) -> Story:
    story = Story()
    for k, part in enumerate(cycle.parts):
        following = k + 1 < len(cycle.parts)
        if isinstance(part, SwingPart):
            _add_swing(cycle, part, story, slice(int(k > 0), -1 if following else None))
        else:
            _add_impact(cycle, part, story)
    return story


def _add_swing(cycle: Cycle, part: SwingPart, story: Story, kept: slice) -> None:
    """Rows of a rigid phase; the first and last are left out where an impact's own rows hold these times."""
    motion, run, totals = part.motion, part.swing, story.totals
    kinetic, potential, tip, plate = [], [], [], []
    for t, theta, rate in zip(run.t, run.theta_t, run.theta_dot_t, strict=True):
        chain = motion.chain.moved_to(t)
        kinetic.append(chain.kinetic_energy(theta, rate) + part.kinetic)
        shift = np.subtract(chain.origin, motion.chain.origin)
        potential.append(chain.potential_energy(theta) - chain.mass * float(shift @ np.asarray(chain.gravity)))
        links = link_placements(chain, theta, rate)
        others = {name: p.after(t - run.t[0]) for name, p in motion.placements.items() if name not in links}
        placed = {**others, **links}
        tip.append(_point(cycle, placed, cycle.scene.tip))
        plate.append(_point(cycle, placed, cycle.scene.target))
    if not story.rows:
        totals.initial = kinetic[0]
    work = np.asarray(potential[0]) - np.asarray(potential) + run.work_t[:, 0] + run.work_t[:, 2]
    heat = run.work_t[:, 1]
    stored = np.asarray(kinetic) + motion.elastic + motion.plastic + motion.hourglass
    error = totals.error(stored) + heat - work
    rows = {name: np.zeros(len(run.t)) for name in ("t", *HISTORY_COLUMNS[1:], *MORE_COLUMNS)}
    rows |= {"t": run.t, "closing_speed": np.full(len(run.t), np.nan)}
    rows |= _velocities(np.array(tip), np.array(plate))
    rows |= {
        "E_kinetic": np.asarray(kinetic),
        "E_internal": np.full(len(run.t), motion.elastic + motion.plastic + motion.hourglass),
        "E_plastic": np.full(len(run.t), motion.plastic),
        "E_friction": np.full(len(run.t), totals.friction),
        "E_total_error": error,
        "E_lost": np.full(len(run.t), totals.lost),
        "external_work": totals.external_work + work,
    }
    rows |= _angles(cycle, motion.chain.angles(run.theta_t).T)
    totals.external_work += float(work[-1])
    totals.joint += float(heat[-1])
    energy = {
        "kinetic": kinetic[-1],
        "elastic": motion.elastic,
        "plastic": motion.plastic,
        "hourglass": motion.hourglass,
        "contact": 0.0,
    }
    phase = _phase("rigid", float(run.t[0]), run.t_end, run.ended_by, energy, totals)
    story.add({name: column[kept] for name, column in rows.items()}, phase)


def _add_impact(cycle: Cycle, part: ImpactPart, story: Story) -> None:
    """Rows of an impact, and what the ways there and back book."""
    account, totals = part.impact.accounts[0], story.totals
    totals.hand_off += part.jump
    totals.lost += part.settled
    rows, energies = account.ledger.history(), account.ledger.energies()
    stored = np.sum([energies[key] for key in ("kinetic", "elastic", "plastic", "hourglass", "contact")], axis=0)
    spent = energies["friction"] + energies["contact_loss"] + energies["joint"]
    rows["t"] = part.start + rows.pop("time_s")
    rows["E_total_error"] = totals.error(stored) + spent - energies["external_work"]
    rows["E_friction"] = totals.friction + rows["E_friction"]
    rows["E_lost"] = np.full(len(stored), totals.lost)
    rows["external_work"] = totals.external_work + energies["external_work"]
    rows |= _angles(cycle, _link_angles(cycle, part))
    last = {key: float(column[-1]) for key, column in energies.items()}
    back = part.back
    totals.external_work += last["external_work"] - (back.drive_work if back else 0.0)
    totals.friction += last["friction"]
    totals.contact_loss += last["contact_loss"]
    totals.joint += last["joint"]
    totals.lost += part.lost
    totals.hand_off += part.jump_back
    energy = {key: last[key] for key in ("kinetic", "elastic", "plastic", "hourglass", "contact")}
    phase = _phase("impact", part.start, part.end, part.ended_by, energy, totals)
    more: dict[str, Any] = {"lost": part.lost, "settled": part.settled, "jump": part.jump, "jump_back": part.jump_back}
    more["hinge_impulse"] = {name: impulse.tolist() for name, impulse in part.hinge_impulse.items()}
    if back:
        more["vibration"] = {"kinetic": back.vibration_energy, "elastic": part.lost - back.vibration_energy}
    story.add(rows, {**phase, **more})


def _phase(
    kind: str, start: float, end: float, ended_by: str, energy: Mapping[str, float], totals: Totals
) -> dict[str, Any]:
    """What the summary says of a phase: its ledger at the end, what follows from the way back included."""
    spent = {name: getattr(totals, name) for name in vars(totals)}
    return {
        "kind": kind,
        "start": start,
        "end": end,
        "ended_by": ended_by,
        "energy": {**energy, **spent},
        "lost": 0.0,
    }


def _point(cycle: Cycle, placements: Mapping[str, Any], point: Any) -> Array:
    """Velocity of a scene's point in a rigid phase [m/s], shape (3,), nan where there is none."""
    if point is None:
        return np.full(3, np.nan)
    return placements[point.body].place(np.array([point.at]))[1][0]


def _velocities(tip: Array, plate: Array) -> Columns:
    columns = {f"tip_v{axis}": tip[:, k] for k, axis in enumerate("xyz")}
    return columns | {f"plate_v{axis}": plate[:, k] for k, axis in enumerate("xyz")}


def _angles(cycle: Cycle, angles: Array) -> Columns:
    return {f"theta_{link.body}": column for link, column in zip(cycle.chain.links, angles, strict=True)}


def _link_angles(cycle: Cycle, part: ImpactPart) -> Array:
    """Angle of each link at the rows of an impact [rad], shape (link_count, row_count), float64.

    It is that of the line from a node at the inbound hinge to the node farthest from it, whose velocities are summed
    by the trapezoidal rule.
    """
    account = part.impact.accounts[0]
    model, velocity = account.ready.model, np.array(account.ledger.kept.velocities)
    u, _ = part.impact.at_last_record()
    found = []
    for k, link in enumerate(cycle.chain.links):
        near, far = model.points[2 + 2 * k : 4 + 2 * k]
        rate = velocity[:, 3 + 2 * k, :2] - velocity[:, 2 + 2 * k, :2]
        step = 0.5 * part.impact.steps.interval * (rate[1:] + rate[:-1])
        way = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
        line = (model.X + u)[far, :2] - (model.X + u)[near, :2] + way - way[-1]
        points = cycle.meshes[link.body].points
        a, b = cycle.link_ends(link.body)
        own = (points[b] - points[a])[:2]
        turned = np.unwrap(np.arctan2(line[:, 1], line[:, 0])) - np.arctan2(own[1], own[0])
        theta = -turned - 0.5 * np.pi
        found.append(theta + 2.0 * np.pi * np.round((part.theta[k] - theta[0]) / (2.0 * np.pi)))
    return np.array(found)


def _contacts(cycle: Cycle, results: Sequence[Result], story: Story) -> tuple[ContactHistory, ...]:
    """Forces of each contact over all phases; none act in rigid ones."""
    found = []
    for k, name in enumerate(contact_names(cycle.scene.contacts)):
        own = iter([result.contacts[k] for result in results])
        parts = [
            next(own) if phase["kind"] == "impact" else _open(name, len(rows["t"]))
            for phase, rows in zip(story.phases, story.rows, strict=True)
        ]
        joined = {
            f: np.concatenate([getattr(part, f) for part in parts])
            for f in ("force", "pressure", "normal_force", "closing_speed")
        }
        found.append(ContactHistory(name=name, **joined))
    return tuple(found)


def _open(name: str, rows: int) -> ContactHistory:
    return ContactHistory(
        name=name,
        force=np.zeros((rows, 3)),
        pressure=np.zeros(rows),
        normal_force=np.zeros((rows, 3)),
        closing_speed=np.full(rows, np.nan),
    )


def _paths(results: Sequence[Result], story: Story) -> tuple[PathHistory, ...]:
    """Stress along the paths; rigid phases have none, which is nan."""
    if not results:
        return ()
    found = []
    for k, path in enumerate(results[0].paths):
        own = iter([result.paths[k].stress for result in results])
        parts = [
            next(own) if phase["kind"] == "impact" else np.full((len(rows["t"]), *path.stress.shape[1:]), np.nan)
            for phase, rows in zip(story.phases, story.rows, strict=True)
        ]
        found.append(replace(path, stress=np.concatenate(parts).astype(np.float32)))
    return tuple(found)


def _without_impact(cycle: Cycle, history: Columns) -> dict[str, Any]:
    """The summary of a run that touched nothing."""
    start, scene = cycle.first, cycle.scene
    facts = RunFacts(
        scene=scene.name,
        n_elements=sum(item.cell_count for item in cycle.meshes.values()),
        n_nodes=sum(len(item.points) for item in cycle.meshes.values()),
        dt=0.0,
        n_steps=0,
        simulated_time=0.0,
        wall=cycle.clock.wall,
        device=cycle.settings.device,
        precision=cycle.settings.precision,
        element=" ".join(sorted({body.element for body in scene.bodies})),
        energy_error=0.0,
        energy={},
        max_plastic_strain=0.0,
        parameters=scene.parameters,
        theta=tuple(float(x) for x in start.theta),
        theta_dot=tuple(float(x) for x in start.theta_dot),
        more={"energy_drift_rigid": start.energy_drift},
    )
    return summarise(history, facts)


def _of_all(
    cycle: Cycle,
    story: Story,
    results: Sequence[Result],
    contacts: Sequence[ContactHistory],
    t_contact: float,
) -> dict[str, Any]:
    """What the summary says of all phases, in place of what it says of the first impact."""
    impacts = [part for part in cycle.parts if isinstance(part, ImpactPart)]
    offsets = [part.start - t_contact for part in impacts]
    summaries = [result.summary for result in results]

    def spans(key: str) -> list[list[float]]:
        return list(_shifted(summaries, offsets, key))

    def greatest(key: str, least: float = 0.0) -> float:
        return max((summary[key] for summary in summaries), default=least)

    last = story.phases[-1]["energy"]
    totals = story.totals
    energy = {**last, "error": totals.error(sum(last[k] for k in ("kinetic", "elastic", "plastic", "hourglass")))}
    steps = sum(summary["n_steps"] for summary in summaries)
    fe, elements = cycle.clock.wall["fe"], summaries[0]["n_elements"] if summaries else 0
    pairs = [
        _pair(pair, [summary["contacts_by_pair"][k] for summary in summaries], offsets)
        for k, pair in enumerate(contacts)
    ]
    joints = [summary["joint_impulse"] for summary in summaries]
    found: dict[str, Any] = {
        "phases": story.phases,
        "contacts": spans("contacts"),
        "F_n_peaks": spans("F_n_peaks"),
        "sticks": spans("sticks"),
        "contact_duration": sum(summary["contact_duration"] for summary in summaries),
        "contacts_by_pair": pairs,
        "touched": any(summary["touched"] for summary in summaries),
        "contact_open_at_end": bool(summaries) and summaries[-1]["contact_open_at_end"],
        "n_steps": steps,
        "simulated_time": sum(summary["simulated_time"] for summary in summaries),
        "energy": energy,
        "energy_error": story.error / story.scale if story.scale > 0.0 else 0.0,
        "max_plastic_strain": greatest("max_plastic_strain"),
        "joint_impulse": {name: np.sum([j[name] for j in joints], axis=0).tolist() for name in (joints or [{}])[0]},
        "element_steps_per_s": elements * steps / fe if fe > 0.0 and steps else None,
        "wall": dict(cycle.clock.wall),
    }
    for key in ("F_n_max", "F_t_max"):
        found[key] = greatest(key)
    found["F_t_min"] = min((summary["F_t_min"] for summary in summaries), default=0.0)
    found["F_t_reverses"] = any(summary["F_t_reverses"] for summary in summaries)
    if summaries:
        found["extremes"] = _extremes([summary["extremes"] for summary in summaries])
        found["max_strain"], found["max_penetration"] = greatest("max_strain"), greatest("max_penetration")
    return found


def _extremes(items: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {key: (min if key == "min_jacobian" else max)(item[key] for item in items) for key in items[0]}


def _shifted(summaries: Sequence[Mapping[str, Any]], offsets: Sequence[float], key: str) -> Iterator[list[float]]:
    """Spans, or times and values, of each impact at the time of the run [s]."""
    for summary, offset in zip(summaries, offsets, strict=True):
        for first, second in summary[key]:
            yield [first + offset, second if key == "F_n_peaks" else second + offset]


def _pair(pair: ContactHistory, found: Sequence[Mapping[str, Any]], offsets: Sequence[float]) -> dict[str, Any]:
    """What the summary says of a contact, from what it says of it in each impact."""
    forces = [item["F_max"] for item in found] or [[0.0, 0.0, 0.0]]
    spans = [(offset, span) for item, offset in zip(found, offsets, strict=True) for span in item["intervals"]]
    return {
        "name": pair.name,
        "intervals": [[start + offset, end + offset] for offset, (start, end) in spans],
        "contact_open_at_end": bool(found) and found[-1]["contact_open_at_end"],
        "F_max": max(forces, key=lambda force: float(np.linalg.norm(force))),
        "impulse": np.sum([[0.0, 0.0, 0.0], *(item["impulse"] for item in found)], axis=0).tolist(),
        "normal": None if pair.normal is None else pair.normal.tolist(),
    }


__all__ = ["Part", "cycle_result"]
