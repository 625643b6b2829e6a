"""Owns the records of a run: what the device summed, turned into histories, energies and guards."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.errors import GuardError

if TYPE_CHECKING:
    from warp_mca.model import Model

Array = NDArray[np.float64]

_FLAGS = (
    "contact lists overflowed: more faces near a node, or nodes near a face, than they hold; mesh both sides alike, "
    "or choose a smaller output_interval if they are fast",
    "a node outran the contact search; choose a smaller output_interval",
    "a node sank deeper than half a face into what it touches; raise penalty, or refine the mesh",
)


class Ledger:
    """Collects one record for each output interval.

    Attributes:
        energy_error: largest imbalance so far, as a share of initial energy and external work [-].
        max_strain: largest deviatoric strain so far [-].
    """

    def __init__(self, model: Model, dt: float, interval: float, tolerance: float) -> None:
        self.model, self.dt, self.interval, self.tolerance = model, dt, interval, tolerance
        self.columns: list[Array] = []
        self.velocities: list[Array] = []
        self.count = 0
        self.energy_error = 0.0
        self.max_strain = 0.0
        self.initial_energy: float | None = None
        self.initial_work = 0.0  # that driven nodes do in the half step before t = 0
        self.energy_scale = 0.0  # greatest so far: at rest the work of gravity returns to nothing

    def read(self, written: int, records: Mapping[str, NDArray]) -> None:
        """Take in the first `written` of the device's `records`, see `Solver.records`, and hold them to the guards.

        Raises:
            GuardError: a record breaks a guard.
        """
        for raised, message in zip(records["flag"], _FLAGS, strict=True):  # these explain what the sums would show
            if raised:
                raise GuardError(f"stopped before t = {(self.count + written) * self.interval:.4g} s: {message}")
        for row in range(written):
            self._add(records["partial"][row], records["point_velocity"][row].copy())

    def _add(self, partial: Array, velocity: Array) -> None:
        from warp_mca.solver import JACOBIAN, STRAIN

        sums = partial.sum(axis=1)
        sums[STRAIN], sums[JACOBIAN] = partial[STRAIN].max(), partial[JACOBIAN].min()
        t = self.count * self.interval
        if not np.isfinite(sums).all():
            raise GuardError(f"energy is not a number at t = {t:.4g} s: the step was unstable; lower time_step_scale")
        if sums[JACOBIAN] <= 0.0:
            raise GuardError(f"an element turned inside out before t = {t:.4g} s; refine the mesh or lower the load")
        self.columns.append(sums)
        self.velocities.append(velocity)
        self.count += 1
        self.max_strain = max(self.max_strain, float(sums[STRAIN]))
        self._balance(sums, t)

    def _energies(self, sums: Array) -> dict[str, float]:
        from warp_mca.solver import DRIVE_WORK, ELASTIC, GRAVITY_WORK, HOURGLASS, KINETIC, PASS, PASS_COLUMNS, PLASTIC

        springs = sums[PASS:].reshape(-1, PASS_COLUMNS)
        return {
            "kinetic": float(sums[KINETIC]),
            "elastic": float(sums[ELASTIC]),
            "plastic": float(sums[PLASTIC]),
            "hourglass": float(sums[HOURGLASS]),
            "contact": float(springs[:, 0].sum()),
            "friction": float(springs[:, 1].sum()),
            "damping": 0.0,
            "joint": 0.0,
            "external_work": float(sums[GRAVITY_WORK] + sums[DRIVE_WORK] + springs[:, 2].sum()) - self.initial_work,
        }

    def _balance(self, sums: Array, t: float) -> None:
        energy = self._energies(sums)
        work = energy.pop("external_work")
        if self.initial_energy is None:
            self.initial_energy, self.initial_work = sum(energy.values()), work
            work = 0.0
        error = sum(energy.values()) - work - self.initial_energy
        self.energy_scale = max(self.energy_scale, abs(self.initial_energy) + abs(work))
        share = abs(error) / self.energy_scale if self.energy_scale > 0.0 else 0.0
        self.energy_error = max(self.energy_error, share)
        if share > self.tolerance:
            raise GuardError(
                f"energy imbalance {share:.2%} at t = {t:.4g} s exceeds energy_tolerance = {self.tolerance:g}: "
                "lower time_step_scale or a contact's penalty, or raise the tolerance if that much is acceptable"
            )

    def energy(self) -> dict[str, float]:
        """The ledger at the end [J]."""
        last = self._energies(self.columns[-1])
        error = sum(value for key, value in last.items() if key != "external_work")
        initial = self.initial_energy or 0.0
        return {"initial": initial, **last, "error": error - last["external_work"] - initial}

    def history(self, first: int = 0) -> dict[str, Array]:
        """The columns of history.csv from row `first` on, each shape (row_count,), float64.

        Forces are means over the interval before.
        """
        from warp_mca.solver import PASS, PASS_COLUMNS

        table = np.array(self.columns[first:])
        energies = [self._energies(row) for row in table]
        energy = {key: np.array([item[key] for item in energies]) for key in energies[0]}
        springs = table[:, PASS:].reshape(len(table), -1, PASS_COLUMNS)
        share = self.dt / self.interval
        F_n, F_t = np.zeros(len(table)), np.zeros(len(table))
        for k, item in enumerate(self.model.passes):
            force = share * item.sign * springs[:, k, 3:6]
            normal, tangent = self.model.contact_axes[item.contact]
            F_n += force @ normal
            F_t += force @ tangent
        pressed, stuck = springs[:, :, 6].sum(axis=1), springs[:, :, 7].sum(axis=1)
        stick: Array = np.zeros(len(table))
        np.divide(stuck, pressed, out=stick, where=pressed > 0.0)
        velocity = np.array(self.velocities[first:])
        velocity[:, self.model.points < 0] = np.nan
        if self.model.points[1] < 0 and self.model.passes and self.model.passes[0].plane is not None:
            velocity[:, 1] = self.model.passes[0].plane.velocity
        stored = energy["elastic"] + energy["plastic"] + energy["hourglass"]
        balance = sum(value for key, value in energy.items() if key != "external_work") - energy["external_work"]
        return {
            "time_s": self.interval * np.arange(first, self.count, dtype=np.float64),
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
