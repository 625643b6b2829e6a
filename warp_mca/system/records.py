"""Owns what a scene has recorded so far: the part of a state that lies on the host."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array


@dataclass(eq=False)
class SceneRecords:
    """Rows of the history, and running sums and extremes over all check records. What has not begun is nan.

    Attributes:
        sums: columns of each row of the history, see `kernels.records.columns`, each shape (column_count,), float64.
        velocities: of the recorded points at each row [m/s], each shape (point_count, 3), float64.
        path_stress: of the scene's probes [Pa], each shape (row_count, probe_count, 6), float32.
        sensors: position [m] and velocity [m/s] of the scene's probes, force [N] and moment [N m] of its sections at
            each row, each shape (channel_count,), float64.
        peaks: of each contact pass at its greatest, sum of normal forces [N] and sum of their squares [N^2], shape
            (pass_count, 2), float64.
        stiffened: of each body, when its strain energy [J] was greatest of a few looks, what `bent_cells` names of the
            bending of its cells, shape (body_count, COLUMNS), float64.
        passed: of each case that `watch.passing_cases` lists, how deep it was seen [m], when first [s], where deepest
            [m] and how deep at the start [m], shape (case_count, 6), float64; empty before the first look.
        due: step from which on the next of these looks is due [-].
        apart: steps between two of them, by the latest one [-]; 0 before the first.
        wait: steps from the latest one until the next is due [-].
        count: rows so far [-].
        records: check records so far, rows included [-].
        energy_error: greatest imbalance, as a share of initial energy and external work [-].
        max_strain: greatest deviatoric strain of any step [-].
        min_jacobian: least ratio of volumes [-], 1 at most.
        initial_energy: stored at the start [J].
        initial_kinetic: kinetic energy at the start [J].
        initial_work: that driven nodes do in the half step before the start [J].
        energy_scale: greatest initial energy and external work so far [J]: at rest the work of gravity returns to none.
        exchanged: greatest energy that was in elements, contact springs and friction, or that motion had gained or
            lost [J].
        imbalance: greatest imbalance [J].
        worked: greatest external work [J].
        damping: energy that damping took so far [J].
        touched: whether a contact spring was ever pressed, 0 or 1 [-].
        turned: whether a pressed node went over to a face across a sharp edge, 0 or 1 [-].
    """

    sums: list[Array] = field(default_factory=list)
    velocities: list[Array] = field(default_factory=list)
    path_stress: list[NDArray[np.float32]] = field(default_factory=list)
    sensors: list[Array] = field(default_factory=list)
    peaks: Array = field(default_factory=lambda: np.zeros((0, 2)))
    stiffened: Array = field(default_factory=lambda: np.zeros((0, 7)))
    passed: Array = field(default_factory=lambda: np.zeros((0, 6)))
    due: int = 0
    apart: int = 0
    wait: int = 0
    count: int = 0
    records: int = 0
    energy_error: float = 0.0
    max_strain: float = 0.0
    min_jacobian: float = 1.0
    initial_energy: float = np.nan
    initial_kinetic: float = 0.0
    initial_work: float = 0.0
    energy_scale: float = 0.0
    exchanged: float = 0.0
    imbalance: float = 0.0
    worked: float = 0.0
    damping: float = 0.0
    touched: bool = False
    turned: bool = False

    def copy(self) -> SceneRecords:
        """A copy of its own; rows, which never change, are shared."""
        lists = {name: list(getattr(self, name)) for name in _LISTS}
        return replace(self, **lists, **{name: getattr(self, name).copy() for name in _EXTREMES})

    def without_rows(self, time: float) -> SceneRecords:
        """What a run goes on with whose history begins anew at a time [s]: sums and extremes so far, no rows."""
        rows = {name: [] for name in _LISTS}
        passed = self.passed - np.array([0.0, time, 0.0, 0.0, 0.0, 0.0])
        return replace(self, **rows, peaks=self.peaks.copy(), passed=passed, count=0, records=0, due=0)

    def arrays(self) -> dict[str, NDArray]:
        """All of it as arrays by name, for a file."""
        found: dict[str, NDArray] = {
            f.name: np.asarray(getattr(self, f.name)) for f in fields(self) if f.name != "path_stress"
        }
        found["path_stress"] = np.concatenate(self.path_stress) if self.path_stress else np.zeros((0, 0, 6), np.float32)
        return found

    @staticmethod
    def of(arrays: Mapping[str, NDArray]) -> SceneRecords:
        """The inverse of `arrays`."""
        found = SceneRecords()
        for f in fields(found):
            array = arrays[f.name]
            if f.name in ("sums", "velocities", "sensors"):
                setattr(found, f.name, list(array))
            elif f.name == "path_stress":
                found.path_stress = [array] if len(array) else []
            elif f.name in _EXTREMES:
                setattr(found, f.name, array)
            else:
                setattr(found, f.name, type(getattr(found, f.name))(array))
        return found

    def differences(self, other: SceneRecords) -> list[str]:
        """Names of what is not the same bit for bit."""
        a, b = self.arrays(), other.arrays()
        return [name for name in a if a[name].shape != b[name].shape or a[name].tobytes() != b[name].tobytes()]


_EXTREMES = ("peaks", "stiffened", "passed")
_LISTS = ("sums", "velocities", "path_stress", "sensors")
