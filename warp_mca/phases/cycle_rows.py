"""Owns the history of a cycle: rows of every phase in one table, energies that add up over the phases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.phases.cycle_setup import Setup
from warp_mca.phases.parts import ImpactPart, Part, SwingPart
from warp_mca.results.result import HISTORY_COLUMNS
from warp_mca.rigid.placement import Placement, link_placements
from warp_mca.scene import Point

Array = NDArray[np.float64]
Columns = dict[str, Array]

MORE_COLUMNS = ("tip_vz", "plate_vy", "plate_vz", "closing_speed")
STORED = ("kinetic", "elastic", "plastic", "hourglass", "contact")
SPENT = ("friction", "contact_loss", "damping", "joint")


@dataclass
class Totals:
    """Energies that add up over the phases [J].

    Attributes:
        initial: kinetic energy at the release.
        external_work: of gravity, moving planes, driven nodes, joint torques and a moving base.
        friction: heat of contacts.
        contact_loss: what springs lost as they became softer.
        damping: what dashpots of contacts dissipated.
        joint: heat of friction in joints.
        lost: energy of vibration that the ways back to rigid bodies left out.
        hand_off: kinetic energy that other inertia gave where nodes took over from rigid links, and back.
    """

    initial: float = 0.0
    external_work: float = 0.0
    friction: float = 0.0
    contact_loss: float = 0.0
    damping: float = 0.0
    joint: float = 0.0
    lost: float = 0.0
    hand_off: float = 0.0

    def error(self, stored: Array | float) -> Any:
        """What the energies of bodies and contacts leave unexplained [J]."""
        spent = self.friction + self.contact_loss + self.damping + self.joint + self.lost
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


def tell_story(setup: Setup, parts: Sequence[Part]) -> Story:
    """The phases of a cycle that is over."""
    story = Story()
    for k, part in enumerate(parts):
        add_part(setup, part, story, kept_rows(part, k == 0, k + 1 < len(parts)))
    return story


def kept_rows(part: Part, first: bool, following: bool) -> slice:
    """Rows of a phase that the history has: of swings not those whose times an impact before or after has too."""
    return slice(int(not first), -1 if following else None) if isinstance(part, SwingPart) else slice(None)


def add_part(setup: Setup, part: Part, story: Story, kept: slice) -> None:
    """Let a story take in a phase that is over."""
    if isinstance(part, SwingPart):
        _add_swing(setup, part, story, kept)
    else:
        _add_impact(setup, part, story)


def _add_swing(setup: Setup, part: SwingPart, story: Story, kept: slice) -> None:
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
        tip.append(_point(placed, setup.scene.tip))
        plate.append(_point(placed, setup.scene.target))
    if not story.rows:
        totals.initial = kinetic[0]
    work = np.asarray(potential[0]) - np.asarray(potential) + run.work_t[:, 0] + run.work_t[:, 2]
    heat = run.work_t[:, 1]
    stored = np.asarray(kinetic) + motion.strain_energy
    error = totals.error(stored) + heat - work
    rows = {name: np.zeros(len(run.t)) for name in ("t", *HISTORY_COLUMNS[1:], *MORE_COLUMNS)}
    rows |= {"t": run.t, "closing_speed": np.full(len(run.t), np.nan)}
    rows |= _velocities(np.array(tip), np.array(plate))
    rows |= {
        "E_kinetic": np.asarray(kinetic),
        "E_internal": np.full(len(run.t), motion.strain_energy),
        "E_plastic": np.full(len(run.t), motion.plastic),
        "E_friction": np.full(len(run.t), totals.friction),
        "E_total_error": error,
        "E_lost": np.full(len(run.t), totals.lost),
        "external_work": totals.external_work + work,
    }
    rows |= _angles(setup, motion.chain.angles(run.theta_t).T)
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


def _add_impact(setup: Setup, part: ImpactPart, story: Story) -> None:
    """Rows of an impact, and what the ways there and back book."""
    scene_run, totals = part.impact.scene_runs[0], story.totals
    totals.hand_off += part.jump
    totals.lost += part.settled
    rows, energies = scene_run.history(), scene_run.ledger.energies()
    stored = np.sum([energies[key] for key in STORED], axis=0)
    spent = np.sum([energies[key] for key in SPENT], axis=0)
    rows["t"] = part.start + rows.pop("time_s")
    rows["E_total_error"] = totals.error(stored) + spent - energies["external_work"]
    rows["E_friction"] = totals.friction + rows["E_friction"]
    rows["E_lost"] = np.full(len(stored), totals.lost)
    rows["external_work"] = totals.external_work + energies["external_work"]
    rows |= _angles(setup, _link_angles(setup, part))
    last = {key: float(column[-1]) for key, column in energies.items()}
    back = part.back
    totals.external_work += last["external_work"] - (back.drive_work if back else 0.0)
    for key in SPENT:
        setattr(totals, key, getattr(totals, key) + last[key])
    totals.lost += part.lost
    totals.hand_off += part.jump_back
    energy = {key: last[key] for key in STORED}
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


def _point(placements: Mapping[str, Placement], point: Point | None) -> Array:
    """Velocity of a scene's point in a rigid phase [m/s], shape (3,), nan where there is none."""
    if point is None:
        return np.full(3, np.nan)
    return placements[point.body].place(np.array([point.at]))[1][0]


def _velocities(tip: Array, plate: Array) -> Columns:
    columns = {f"tip_v{axis}": tip[:, k] for k, axis in enumerate("xyz")}
    return columns | {f"plate_v{axis}": plate[:, k] for k, axis in enumerate("xyz")}


def _angles(setup: Setup, angles: Array) -> Columns:
    return {f"theta_{link.body}": column for link, column in zip(setup.chain.links, angles, strict=True)}


def _link_angles(setup: Setup, part: ImpactPart) -> Array:
    """Angle of each link at the rows of an impact [rad], shape (link_count, row_count), float64.

    It is that of the line from a node at the inbound hinge to the node farthest from it, whose velocities are summed
    by the trapezoidal rule.
    """
    scene_run = part.impact.scene_runs[0]
    model, velocity = scene_run.ready.model, np.array(scene_run.ledger.kept.velocities)
    u, _ = part.impact.at_last_record()
    found = []
    for k, link in enumerate(setup.chain.links):
        near, far = model.points[2 + 2 * k : 4 + 2 * k]
        rate = velocity[:, 3 + 2 * k, :2] - velocity[:, 2 + 2 * k, :2]
        step = 0.5 * part.impact.steps.interval * (rate[1:] + rate[:-1])
        way = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
        line = (model.X + u)[far, :2] - (model.X + u)[near, :2] + way - way[-1]
        points = setup.meshes[link.body].points
        a, b = setup.link_ends(link.body)
        own = (points[b] - points[a])[:2]
        turned = np.unwrap(np.arctan2(line[:, 1], line[:, 0])) - np.arctan2(own[1], own[0])
        theta = -turned - 0.5 * np.pi
        found.append(theta + 2.0 * np.pi * np.round((part.theta[k] - theta[0]) / (2.0 * np.pi)))
    return np.array(found)
