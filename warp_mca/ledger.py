"""Owns the records of a run: what the device summed, turned into histories, energies and guards."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.errors import GuardError

if TYPE_CHECKING:
    from warp_mca.model import Model
    from warp_mca.steps import Steps

Array = NDArray[np.float64]

# Columns of a record, then eight for each contact pass (`kernels.spring.sum_springs`).
KINETIC, GRAVITY_WORK, ELASTIC, PLASTIC, STRAIN, JACOBIAN, HOURGLASS, DRIVE_WORK, PASS = range(9)
PASS_COLUMNS = 8
OVERLAP = 0.01  # share of the energy at the start, in contact springs, that is worth a word when a guard stops the run
LEAST = 1e-7  # of all energy, that counts as exchanged at least

_FLAGS = (
    "contact lists overflowed: more than 32 faces near a node, or more nodes near a face than its list holds; mesh "
    "both sides more alike, or choose a smaller output_interval if they are fast",
    "a node outran the contact search; choose a smaller output_interval",
    "a node sank deeper than half a face into what it touches; raise penalty, refine the mesh, or, if penalty is high, "
    "lower time_step_scale",
)


class Ledger:
    """Collects the records of one scene: rows of its history, and those that check the run between them.

    Attributes:
        count: rows so far.
        records: check records so far, rows included.
        energy_error: largest imbalance so far, as a share of initial energy and external work [-].
        exchanged: largest energy so far that was in elements, contact springs and friction, or that motion had gained
            or lost [J].
        max_strain: greatest deviatoric strain of any step so far [-].
        min_jacobian: smallest ratio of volumes so far, 1 at most: of any step at the centres of elements, of records at
            all their points [-].
        turned: whether a pressed node went over to a face across a sharp edge.
    """

    def __init__(self, model: Model, steps: Steps, tolerance: float, precision: str) -> None:
        self.model, self.steps, self.tolerance = model, steps, tolerance
        self.precision = precision
        self.columns: list[Array] = []
        self.velocities: list[Array] = []
        self.count = self.records = 0
        self.turned = False
        self._hint = ""  # at what else may be wrong
        self.energy_error = 0.0
        self.max_strain = 0.0
        self.min_jacobian = 1.0
        self.initial_energy: float | None = None
        self.initial_work = 0.0  # that driven nodes do in the half step before t = 0
        self.energy_scale = 0.0  # greatest so far: at rest the work of gravity returns to nothing
        self.initial_kinetic = self.exchanged = self.imbalance = 0.0

    @property
    def _width(self) -> int:
        """Columns of a record."""
        return PASS + PASS_COLUMNS * len(self.model.passes)

    def read(self, written: int, records: Mapping[str, NDArray]) -> None:
        """Take in the first `written` of a scene's `records`, see `Layout.records`, and hold them to the guards.

        Raises:
            GuardError: a record breaks a guard.
        """
        sums, velocity = self._sums(records["partial"][:written]), records["point_velocity"][:written]
        if self.records == 0 and written:
            self._hint = self._overlap(sums[0])
        *flags, turned = records["flag"]
        self.turned = bool(turned)
        for raised, message in zip(flags, _FLAGS, strict=True):  # these explain what the sums would show
            if raised:
                end = self.steps.time(self.records + written)
                raise GuardError(f"stopped before t = {end:.4g} s: {message}{self._hint}")
        sound = np.isfinite(sums).all(axis=1) & (sums[:, JACOBIAN] > 0.0)
        good = written if sound.all() else int(np.argmin(sound))
        share = self._balance(sums[:good])
        over = share > self.tolerance
        end = int(np.argmax(over)) + 1 if over.any() else good
        rows = self.rows(end)
        self.columns.extend(sums[rows])
        self.velocities.extend(velocity[rows])
        self.count += len(rows)
        self.records += end
        self.max_strain = max(self.max_strain, float(sums[:end, STRAIN].max(initial=0.0)))
        self.min_jacobian = min(self.min_jacobian, float(sums[:end, JACOBIAN].min(initial=1.0)))
        self.energy_error = max(self.energy_error, float(share[:end].max(initial=0.0)))
        last, t = (self.steps.time(self.records + k) for k in (-1, 0))
        if over.any():
            raise GuardError(
                f"energy imbalance {share[end - 1]:.2%} at t = {last:.4g} s exceeds energy_tolerance = "
                f"{self.tolerance:g}: lower time_step_scale or a contact's penalty{self.other_remedy}, or raise the "
                f"tolerance if that much is acceptable{self._hint}"
            )
        if good < written and not np.isfinite(sums[good]).all():
            raise GuardError(f"energy is not a number at t = {t:.4g} s: the step was unstable; lower time_step_scale")
        if good < written:
            raise GuardError(f"an element turned inside out before t = {t:.4g} s; refine the mesh or lower the load")

    def rows(self, written: int) -> NDArray[np.int_]:
        """Which of the next `written` records are rows of the history."""
        return np.arange(-self.records % self.steps.checks, written, self.steps.checks)

    def _overlap(self, first: Array) -> str:
        """What to say where the first record has contact springs that are pressed; nothing where it has none."""
        energy = self._energies(first)
        pressed, total = energy["contact"], sum(energy.values()) - energy["external_work"]
        if not pressed > OVERLAP * total:
            return ""
        return f"; bodies overlap at the start, where contact springs hold {pressed:.3g} J: move them apart"

    def _sums(self, partial: Array) -> Array:
        """Columns of each record from its partial sums, shape (row_count, column_count)."""
        with np.errstate(over="ignore", invalid="ignore"):  # what is not a number is found out
            sums = partial.sum(axis=2)
        sums[:, STRAIN], sums[:, JACOBIAN] = partial[:, STRAIN].max(axis=1), partial[:, JACOBIAN].min(axis=1)
        return sums

    def _energies(self, sums: Array) -> dict[str, Array]:
        """The ledger [J] of a row of sums, or of each row."""
        springs = sums[..., PASS:].reshape(*sums.shape[:-1], len(self.model.passes), PASS_COLUMNS)
        work = sums[..., GRAVITY_WORK] + sums[..., DRIVE_WORK] + springs[..., 2].sum(axis=-1)
        return {
            "kinetic": sums[..., KINETIC],
            "elastic": sums[..., ELASTIC],
            "plastic": sums[..., PLASTIC],
            "hourglass": sums[..., HOURGLASS],
            "contact": springs[..., 0].sum(axis=-1),
            "friction": springs[..., 1].sum(axis=-1),
            "damping": np.zeros(sums.shape[:-1]),
            "joint": np.zeros(sums.shape[:-1]),
            "external_work": work - self.initial_work,
        }

    def _balance(self, sums: Array) -> Array:
        """Imbalance of each row of sums, as a share of initial energy and external work [-]."""
        energy = self._energies(sums)
        work = energy.pop("external_work")
        stored = sum(energy.values(), np.zeros(len(sums)))
        if self.initial_energy is None and len(sums):
            self.initial_energy, self.initial_work = float(stored[0]), float(work[0])
            self.initial_kinetic = float(energy["kinetic"][0])
            work = work - self.initial_work
        initial = self.initial_energy or 0.0
        scale = np.maximum.accumulate(np.maximum(abs(initial) + np.abs(work), self.energy_scale))
        self.energy_scale = float(scale.max(initial=self.energy_scale))
        imbalance, moved = np.abs(stored - work - initial), np.abs(energy["kinetic"] - self.initial_kinetic)
        self.imbalance = float(imbalance.max(initial=self.imbalance))
        self.exchanged = float(np.maximum(moved, stored - energy["kinetic"]).max(initial=self.exchanged))
        share: Array = np.zeros(len(sums))
        np.divide(imbalance, scale, out=share, where=scale > 0.0)
        return share

    @property
    def other_remedy(self) -> str:
        """What else helps against an imbalance: float32 heats what turns for long."""
        return ", choose --precision float64 if bodies turn for long" if self.precision == "mixed" else ""

    @property
    def exchange_error(self) -> float:
        """Largest imbalance as a share of `exchanged` [-]: the same for all who watch, however fast bodies move along.

        What is exchanged counts as LEAST of the initial energy and external work at least, so that the rounding of
        motion alone counts for little.
        """
        scale = max(self.exchanged, LEAST * self.energy_scale)
        return self.imbalance / scale if scale > 0.0 else 0.0

    def energy(self) -> dict[str, float]:
        """The ledger at the end [J]; not numbers where no record was taken in."""
        sums = self.columns[-1] if self.columns else np.full(self._width, np.nan)
        last = {key: float(value) for key, value in self._energies(sums).items()}
        error = sum(value for key, value in last.items() if key != "external_work")
        initial = self.initial_energy or 0.0
        return {"initial": initial, **last, "error": error - last["external_work"] - initial}

    def history(self, first: int = 0) -> dict[str, Array]:
        """The columns of history.csv from row `first` on, each shape (row_count,), float64.

        Forces are means over the interval before.
        """
        table = np.array(self.columns[first:]).reshape(-1, self._width)
        energy = self._energies(table)
        springs = table[:, PASS:].reshape(len(table), len(self.model.passes), PASS_COLUMNS)
        share = self.steps.dt / self.steps.interval
        F_n, F_t = np.zeros(len(table)), np.zeros(len(table))
        for k, item in enumerate(self.model.passes):
            force = share * item.sign * springs[:, k, 3:6]
            normal, tangent = self.model.contact_axes[item.contact]
            F_n += force @ normal if normal.any() else share * springs[:, k, 6]  # see `Model.contact_axes`
            F_t += force @ tangent
        pressed, stuck = springs[:, :, 6].sum(axis=1), springs[:, :, 7].sum(axis=1)
        stick: Array = np.zeros(len(table))
        np.divide(stuck, pressed, out=stick, where=pressed > 0.0)
        velocity = np.array(self.velocities[first:]).reshape(-1, 2, 3)
        velocity[:, self.model.points < 0] = np.nan
        if self.model.points[1] < 0 and self.model.passes and self.model.passes[0].plane is not None:
            velocity[:, 1] = self.model.passes[0].plane.velocity
        stored = energy["elastic"] + energy["plastic"] + energy["hourglass"]
        balance = sum(value for key, value in energy.items() if key != "external_work") - energy["external_work"]
        return {
            "time_s": self.steps.interval * np.arange(first, self.count, dtype=np.float64),
            "F_n_N": F_n,
            "F_t_N": F_t,
            "stick_fraction": stick,
            "tip_vx": velocity[:, 0, 0],
            "tip_vy": velocity[:, 0, 1],
            "plate_vx": velocity[:, 1, 0],
            "E_kinetic": energy["kinetic"],
            "E_internal": stored,
            "E_plastic": energy["plastic"],
            "E_contact": energy["contact"],
            "E_friction": energy["friction"],
            "E_total_error": balance - (self.initial_energy or 0.0),
        }
