"""Owns the history of a cycle: rows of every phase in one table, energies that add up over the phases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.model.sensors import CHANNELS, Spot
from warp_mca.phases.history_rows import Rows, phase_facts
from warp_mca.phases.motion import ImpactPart, Part, SwingPart
from warp_mca.phases.prepare import Setup
from warp_mca.results.result import HISTORY_COLUMNS
from warp_mca.rigid.placement import Placement
from warp_mca.scene import Point

Array = NDArray[np.float64]

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


class Story:
    """The phases of a cycle, one after the other.

    Attributes:
        parts: what each phase added.
        rows: of each phase. Times count from the first touch.
        totals: energies so far.
        error: greatest energy that was not explained [J].
        scale: greatest initial energy and external work so far [J].
    """

    def __init__(self, setup: Setup) -> None:
        self.setup, self.totals, self.error, self.scale = setup, Totals(), 0.0, 0.0
        self.parts: list[Part] = []
        self.rows: list[Rows] = []

    @property
    def impacts(self) -> list[ImpactPart]:
        """The parts that are impacts."""
        return [part for part in self.parts if isinstance(part, ImpactPart)]

    @property
    def origin(self) -> float:
        """Time of the first touch that could be computed, from the release [s]; 0 without one."""
        return 0.0 if self.parts[0].stopped else self.setup.start.t_contact or 0.0

    def add(self, part: Part, following: bool) -> slice:
        """Take in a phase that is over; `following`: another one follows.

        Returns:
            Which samples of a swing are rows: not those whose times an impact before or after has too.
        """
        kept = slice(int(bool(self.parts)), -1 if following else None)
        self.parts.append(part)
        rows = self._swing(part, kept) if isinstance(part, SwingPart) else self._impact(part)
        history = dict(rows.history)
        history["time_s"] = history["time_s"] - self.origin
        self.rows.append(replace(rows, history=history))
        self.error = max(self.error, float(np.abs(history["E_total_error"]).max(initial=0.0)))
        self.scale = max(self.scale, abs(self.totals.initial) + abs(self.totals.external_work))
        return kept

    def _swing(self, part: SwingPart, kept: slice) -> Rows:
        """Rows of a rigid phase. Sections of bodies that are rigid for the time being have nan."""
        motion, run, totals, setup = part.motion, part.swing, self.totals, self.setup
        unknown = np.full(CHANNELS * len(setup.sensors.cuts), np.nan)
        kinetic, potential, tip, plate, sensors = [], [], [], [], []
        for k, (theta, rate) in enumerate(zip(run.theta_t, run.theta_dot_t, strict=True)):
            chain, placed = part.chain(k), part.placements(k)
            kinetic.append(chain.kinetic_energy(theta, rate) + part.kinetic)
            shift = np.subtract(chain.origin, motion.chain.origin)
            potential.append(chain.potential_energy(theta) - chain.mass * float(shift @ np.asarray(chain.gravity)))
            tip.append(_point(placed, setup.scene.tip))
            plate.append(_point(placed, setup.scene.target))
            spots = [placed[spot.body].place(self._spot(part, spot)[None]) for spot in setup.sensors.spots]
            sensors.append(np.concatenate([*(column[0] for spot in spots for column in spot), unknown]))
        if not self.rows:
            totals.initial = kinetic[0]
        work = np.asarray(potential[0]) - np.asarray(potential) + run.work_t[:, 0] + run.work_t[:, 2]
        heat = run.work_t[:, 1]
        error = totals.error(np.asarray(kinetic) + motion.strain_energy) + heat - work
        count = len(run.t)
        rows = {name: np.zeros(count) for name in (*HISTORY_COLUMNS, *MORE_COLUMNS)}
        rows |= {"time_s": run.t, "closing_speed": np.full(count, np.nan)}
        rows |= _velocities(np.array(tip), np.array(plate))
        rows |= {
            "E_kinetic": np.asarray(kinetic),
            "E_internal": np.full(count, motion.strain_energy),
            "E_plastic": np.full(count, motion.plastic),
            "E_friction": np.full(count, totals.friction),
            "E_total_error": error,
            "E_lost": np.full(count, totals.lost),
            "external_work": totals.external_work + work,
        }
        rows |= {name: np.full(count, getattr(totals, key)) for name, key in self._spent.items()}
        rows |= self._angles(motion.chain.angles(run.theta_t).T)
        totals.external_work += float(work[-1])
        totals.joint += float(heat[-1])
        bodies = {"elastic": motion.elastic, "plastic": motion.plastic, "hourglass": motion.hourglass, "contact": 0.0}
        energy = {"kinetic": kinetic[-1], **bodies, **vars(totals)}
        return Rows(
            history={name: column[kept] for name, column in rows.items()},
            facts=phase_facts("rigid", float(run.t[0]), run.t_end, run.ended_by, energy),
            sensors=sensors[kept],
        )

    @property
    def _spent(self) -> dict[str, str]:
        """Entries of the ledger that loads within bodies add, by their columns."""
        return {f"E_{key}": key for load in self.setup.scene.loads for key in load.energies}

    def _spot(self, part: SwingPart, spot: Spot) -> Array:
        """Where a probe is in its body's frame [m], shape (3,)."""
        return spot.weight @ part.motion.points(spot.body, self.setup.meshes[spot.body].points)[spot.node]

    def _impact(self, part: ImpactPart) -> Rows:
        """Rows of an impact, and what the ways there and back book."""
        scene_run, totals, back = part.impact.scene_runs[0], self.totals, part.back
        totals.hand_off += part.jump
        totals.lost += part.settled
        own, energies = scene_run.rows(), scene_run.ledger.energies()
        rows = dict(own.history)
        stored = np.sum([energies[key] for key in STORED], axis=0)
        spent = np.sum([energies[key] for key in SPENT], axis=0)
        rows["time_s"] = part.start + rows["time_s"]
        rows["E_total_error"] = totals.error(stored) + spent - energies["external_work"]
        rows["E_friction"] = totals.friction + rows["E_friction"]
        rows |= {name: getattr(totals, key) + rows[name] for name, key in self._spent.items()}
        rows["E_lost"] = np.full(len(stored), totals.lost)
        rows["external_work"] = totals.external_work + energies["external_work"]
        rows |= self._angles(_link_angles(self.setup, part))
        last = {key: float(column[-1]) for key, column in energies.items()}
        totals.external_work += last["external_work"] - (back.drive_work if back else 0.0)
        for key in SPENT:
            setattr(totals, key, getattr(totals, key) + last[key])
        totals.lost += part.lost
        totals.hand_off += part.jump_back
        energy = {**{key: last[key] for key in STORED}, **vars(totals)}
        facts = phase_facts("impact", part.start, part.end, part.ended_by, energy)
        facts |= {"lost": part.lost, "settled": part.settled, "jump": part.jump, "jump_back": part.jump_back}
        facts["hinge_impulse"] = {name: impulse.tolist() for name, impulse in part.hinge_impulse.items()}
        if back:
            facts["vibration"] = {"kinetic": back.vibration_energy, "elastic": part.lost - back.vibration_energy}
        return replace(own, history=rows, facts=facts)

    def _angles(self, angles: Array) -> dict[str, Array]:
        """Columns of the links' angles [rad], from an array of shape (link_count, row_count)."""
        return {f"theta_{link.body}": own for link, own in zip(self.setup.chain.links, angles, strict=True)}


def _point(placements: Mapping[str, Placement], point: Point | None) -> Array:
    """Velocity of a scene's point in a rigid phase [m/s], shape (3,), nan where there is none."""
    if point is None:
        return np.full(3, np.nan)
    return placements[point.body].place(np.array([point.at]))[1][0]


def _velocities(tip: Array, plate: Array) -> dict[str, Array]:
    columns = {f"tip_v{axis}": tip[:, k] for k, axis in enumerate("xyz")}
    return columns | {f"plate_v{axis}": plate[:, k] for k, axis in enumerate("xyz")}


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
