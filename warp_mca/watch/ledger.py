"""Owns the energy balance of a run, from the records that the device summed, and has its guards look at these."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.kernels.records.columns import (
    CARRIAGE,
    DAMPED,
    DRIVE_WORK,
    ELASTIC,
    FRICTION,
    GRAVITY_WORK,
    HOURGLASS,
    JACOBIAN,
    JOINT_HEAT,
    KINETIC,
    LOAD_WORK,
    LOST,
    MADE,
    NORMAL_IMPULSE,
    PASS,
    PASS_COLUMNS,
    PLANE_WORK,
    PLASTIC,
    PRESSURE,
    SPRING_ENERGY,
    SQUARES,
    STRAIN,
    VISCOUS,
)
from warp_mca.model.viscosity import thermal_energy
from warp_mca.system.columns import added_columns, column_count
from warp_mca.system.records import SceneRecords
from warp_mca.watch.guards import Reading, stop
from warp_mca.watch.remedies import imbalance_remedy, let_go, pair_of
from warp_mca.watch.row import When

if TYPE_CHECKING:
    from warp_mca.step.steps import Steps
    from warp_mca.system.model import Model

Array = NDArray[np.float64]

MIN_EXCHANGE = 1e-7  # share of all energy below which exchanged energy is not counted
MIN_FREE_EXCHANGE = 1e-4  # the same without contact: what turns on joints in `mixed` gains 5e-6 by rounding in 6 ms
MOST = 2.0  # tolerances by which contact springs may be off, see `kernels.contact.balance`
MOSTLY = 0.5  # share of the imbalance that one contact explains, from which on a stop names it
HEAT = {"mixed": 1e-3, "float64": 1e-12}  # share of `thermal_energy` that counts as rounding: 10^4 times that of sums
TURNED = 0.01  # angle from which on the rounding of float32 heats what turns [rad]


class Ledger:
    """Takes in the records of one scene, keeps its rows and its energy balance, and stops it where a guard is broken.

    Attributes:
        kept: what it has taken in so far, a part of the run's state.
    """

    def __init__(
        self, model: Model, steps: Steps, tolerance: float, precision: str, kept: SceneRecords, framed: bool = False
    ) -> None:
        """Go on from what is `kept`; the energy balance may be off by the share `tolerance`.

        `framed`: elements compute in floating frames.
        """
        self.model, self.steps, self.tolerance, self.precision = model, steps, tolerance, precision
        self.kept, self.framed = kept, framed
        self._table: tuple[tuple[int, int], Array] = (0, 0), np.zeros((0, self._width))
        if not len(kept.peaks):
            kept.peaks = np.zeros((len(model.passes), 2))
        self.spin = _spin(model)
        self.rounding = _rounding(model, steps.dt / (model.rates.substeps if model.rates else 1))
        self.rounding += HEAT[precision] * thermal_energy(model)

    @property
    def contact_dt(self) -> float:
        """Time step of contacts [s]."""
        return self.steps.dt / self.model.common_steps

    @property
    def absorbs(self) -> bool:
        """Whether the scene has absorbing boundaries."""
        return len(self.model.absorbing.node) > 0

    @property
    def _width(self) -> int:
        """Columns of a row: those of a record, and the damping between records."""
        return column_count(self.model) + 1

    def read(self, written: int, records: Mapping[str, NDArray]) -> None:
        """Take in the first `written` of a scene's `records`, see `Layout.records`, and hold them to the guards.

        Raises:
            GuardError: a record breaks a guard.
        """
        sums, velocity = self._sums(records["partial"][:written]), records["point_velocity"][:written]
        *flags, turned = records["flag"]
        self.kept.turned = bool(turned)
        stop(When.FLAGS, Reading(ledger=self, flags=flags, time=self.time(written)))  # explain what sums would show
        sound = np.isfinite(sums).all(axis=1) & (sums[:, JACOBIAN] > 0.0)
        good = written if sound.all() else int(np.argmin(sound))
        share, counted, scale = self._balance(sums[:good])
        over = counted > self.tolerance
        end = int(np.argmax(over)) + 1 if over.any() else good
        self._note_peaks(sums[:end])
        rows = self.rows(end)
        self.kept.sums.extend(sums[rows])
        self.kept.velocities.extend(velocity[rows])
        self.kept.count += len(rows)
        self.kept.records += end
        self.kept.max_strain = max(self.kept.max_strain, float(sums[:end, STRAIN].max(initial=0.0)))
        self.kept.min_jacobian = min(self.kept.min_jacobian, float(sums[:end, JACOBIAN].min(initial=1.0)))
        self.kept.energy_error = max(self.kept.energy_error, float(share[:end].max(initial=0.0)))
        balance = (float(share[end - 1]), float(scale[end - 1])) if over.any() else None
        latest = sums[end - 1] if balance else sums[good] if good < written else None
        stop(When.RECORDS, Reading(ledger=self, flags=(), time=self.time(), sums=latest, balance=balance))

    def time(self, later: int = 0) -> float:
        """Of the next record, or so many `later` [s]."""
        return self.steps.time(self.kept.records + later)

    def rows(self, written: int) -> NDArray[np.int_]:
        """Which of the next `written` records are rows of the history."""
        return np.arange(-self.kept.records % self.steps.checks, written, self.steps.checks)

    def _sums(self, partial: Array) -> Array:
        """Columns of each record from its partial sums, shape (row_count, column_count)."""
        with np.errstate(over="ignore", invalid="ignore"):  # what is not a number is found out
            sums = partial[:, : self._width - 1].sum(axis=2)  # others of a batch may absorb
        sums[:, STRAIN], sums[:, JACOBIAN] = partial[:, STRAIN].max(axis=1), partial[:, JACOBIAN].min(axis=1)
        return np.append(sums, np.full((len(sums), 1), self.kept.damping), axis=1)

    def springs(self, sums: Array) -> Array:
        """Columns of `sum_springs` for each contact pass, shape (..., pass_count, PASS_COLUMNS)."""
        end = PASS + PASS_COLUMNS * len(self.model.passes)
        return sums[..., PASS:end].reshape(*sums.shape[:-1], len(self.model.passes), PASS_COLUMNS)

    def _energies(self, sums: Array) -> dict[str, Array]:
        """The ledger [J] of a row of sums, or of each row."""
        springs = self.springs(sums)
        work = sums[..., GRAVITY_WORK] + sums[..., DRIVE_WORK] + sums[..., LOAD_WORK]
        work = work + springs[..., PLANE_WORK].sum(axis=-1)
        found = {
            "kinetic": sums[..., KINETIC] + sums[..., CARRIAGE],
            "elastic": sums[..., ELASTIC],
            "plastic": sums[..., PLASTIC],
            "hourglass": sums[..., HOURGLASS],
            "contact": springs[..., SPRING_ENERGY].sum(axis=-1),
            "friction": springs[..., FRICTION].sum(axis=-1),
            "contact_loss": np.maximum(springs[..., LOST].sum(axis=-1), 0.0),  # springs that begin with more made it
            "damping": springs[..., DAMPED].sum(axis=-1) + sums[..., VISCOUS] + sums[..., -1],
            "joint": sums[..., JOINT_HEAT],
            "absorbed": np.zeros(sums.shape[:-1]),
            "external_work": work,
        }
        for own in added_columns(self.model).values():
            for k, name in enumerate(own.energies):
                found[name] = found.get(name, 0.0) + sums[..., own.first + k]
        return found | {"external_work": found["external_work"] - self.kept.initial_work}

    def _made(self, sums: Array) -> Array:
        """Energy that springs of each pass made since the first row [J], shape (..., pass_count)."""
        made = self.springs(sums)[..., MADE]
        return made - (self.springs(self.kept.sums[0])[:, MADE] if self.kept.sums else made[:1])

    def cause(self, sums: Array) -> tuple[str, str]:
        """The contact whose springs made or lost most of a record's imbalance, if one did, and what helps."""
        energy = self._energies(sums)
        work = energy.pop("external_work")
        net = float(sum(energy.values(), np.zeros(())) - work - self.initial_energy)
        made = self._made(sums)
        for k in {item.contact for item in self.model.passes}:
            own = [item.contact == k for item in self.model.passes]
            share = float(made[own].sum())
            if share * net > MOSTLY * net * net:
                item = self.model.passes[own.index(True)]
                did = f"{'lost' if share < 0.0 else 'made'} {abs(share):.3g} J"
                remedy = let_go(item) if share < 0.0 and item.plane is None else self.remedy
                return f", of which contact springs of {pair_of(self.model, item)} {did}", remedy
        return "", self.remedy

    def _balance(self, sums: Array) -> tuple[Array, Array, Array]:
        """Imbalance of each row of sums; what counts of it; both over initial energy and external work [-]; these [J].

        Of what contact springs made 1 / MOST counts: it goes with the step, and with the penalty.
        """
        energy = self._energies(sums)
        work = energy.pop("external_work")
        stored = sum(energy.values(), np.zeros(len(sums)))
        if np.isnan(self.kept.initial_energy) and len(sums):
            self.kept.initial_energy, self.kept.initial_work = float(stored[0]), float(work[0])
            self.kept.initial_kinetic = float(energy["kinetic"][0])
            work = work - self.kept.initial_work
        initial = self.initial_energy
        released = np.maximum(-energy.get("spring", np.zeros(len(sums))), 0.0)  # by springs with a preload alone
        scale = np.maximum.accumulate(np.maximum(abs(initial) + np.abs(work) + released, self.kept.energy_scale))
        self.kept.energy_scale = float(scale.max(initial=self.kept.energy_scale))
        self.kept.touched = self.kept.touched or bool(
            (self.springs(sums)[..., NORMAL_IMPULSE] > 0.0).any() or (energy["contact"] > 0.0).any()
        )
        self.kept.worked = float(np.abs(work).max(initial=self.kept.worked))
        made, net = self._made(sums).sum(axis=-1), stored - work - initial
        imbalance, moved = np.abs(net), np.abs(energy["kinetic"] - self.kept.initial_kinetic)
        self.kept.imbalance = float(imbalance.max(initial=self.kept.imbalance))
        self.kept.exchanged = float(np.maximum(moved, stored - energy["kinetic"]).max(initial=self.kept.exchanged))
        scale = np.maximum(scale, self.rounding)
        shares = np.zeros((2, len(sums)))
        counted = np.maximum(np.minimum(imbalance, np.abs(net - made)), imbalance / MOST)
        np.divide([imbalance, counted], scale, out=shares, where=scale > 0.0)
        return shares[0], shares[1], scale

    @property
    def initial_energy(self) -> float:
        """Energy at the start [J]; 0 before the first record."""
        return 0.0 if np.isnan(self.kept.initial_energy) else self.kept.initial_energy

    @property
    def remedy(self) -> str:
        """What helps against an imbalance."""
        turned = self.precision == "mixed" and self.spin * self.time() > TURNED and not self.framed
        return imbalance_remedy(self.model, self.kept.touched, turned)

    @property
    def exchanges(self) -> bool:
        """Whether bodies exchanged energy worth a word, by contact, joints or external work."""
        least = (MIN_EXCHANGE if self.kept.touched else MIN_FREE_EXCHANGE) * self.kept.energy_scale
        joined = len(self.model.joint_first) > 0 or bool(self.model.body_joints)
        met = self.kept.touched or joined or self.kept.worked > least
        return met and self.kept.exchanged > max(least, self.rounding)

    @property
    def exchange_error(self) -> float:
        """Largest imbalance as a share of `exchanged` [-]: the same for all who watch, however fast bodies move along.

        What is exchanged counts as MIN_EXCHANGE of the initial energy and external work at least, and as the energy of
        rounding, so that the rounding of motion alone counts for little.
        """
        scale = max(self.kept.exchanged, MIN_EXCHANGE * self.kept.energy_scale, self.rounding)
        return self.kept.imbalance / scale if scale > 0.0 else 0.0

    def nodes_at_peak(self, k: int) -> float:
        """Nodes that carried contact pass k in the record of its greatest normal force: (sum F)^2 / sum F^2 [-]."""
        force, squares = self.kept.peaks[k]
        return float(force**2 / squares) if squares > 0.0 else 0.0

    def _note_peaks(self, sums: Array) -> None:
        """Keep what records say of contact at its greatest."""
        springs = self.springs(sums)
        for k, found in enumerate(
            springs[springs[:, :, PRESSURE].argmax(axis=0), range(springs.shape[1])] if len(sums) else ()
        ):
            if found[PRESSURE] > self.kept.peaks[k, 0]:
                self.kept.peaks[k] = found[PRESSURE], found[SQUARES]

    def energy(self, row: int = -1) -> dict[str, float]:
        """The ledger at a row of the history, the last one by default [J]; not numbers where no record was taken in."""
        sums = self.kept.sums[row] if self.kept.sums else np.full(self._width, np.nan)
        last = {key: float(value) for key, value in self._energies(sums).items()}
        error = sum(value for key, value in last.items() if key != "external_work")
        initial = self.initial_energy
        return {"initial": initial, **last, "error": error - last["external_work"] - initial}

    def energies(self, first: int = 0) -> dict[str, Array]:
        """The ledger [J] at each row of the history from row `first` on, see `energy`, each shape (row_count,)."""
        return self._energies(self.table(first))

    def table(self, first: int = 0) -> Array:
        """Columns of each row of the history from row `first` on, shape (row_count, column_count), float64.

        It is made once for all who read the same rows, which never change.
        """
        asked = first, len(self.kept.sums)
        if self._table[0] != asked:
            self._table = asked, np.array(self.kept.sums[first:]).reshape(-1, self._width)
            self._table[1].flags.writeable = False
        return self._table[1]


def _spin(model: Model) -> float:
    """Greatest angular speed of a body at the start, from the velocities of its nodes about their mean [rad/s]."""
    greatest = 0.0
    first = sorted(model.node_start.values())
    for begin, end in zip(first, [*first[1:], model.node_count], strict=True):
        share = model.mass[begin:end, None] / model.mass[begin:end].sum()
        with np.errstate(over="ignore", invalid="ignore"):
            arm, velocity = (x - (share * x).sum(axis=0) for x in (model.X[begin:end], model.V[begin:end]))
            rate = np.sqrt((share * velocity**2).sum() / (share * arm**2).sum())
        greatest = max(greatest, float(rate)) if np.isfinite(rate) else greatest
    return greatest


def _rounding(model: Model, dt: float) -> float:
    """Energy of all bodies that move by four times the rounding of positions in a step [J]: no balance is finer."""
    speed = 4.0 * float(np.spacing(np.abs(model.X).max())) / dt
    return 0.5 * float(model.mass.sum()) * speed * speed
