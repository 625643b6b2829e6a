"""Owns what probes and sections recorded: their histories, probes.npz and probes.csv, their figures in the summary."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.results.cfc import cfc_filter, is_even
from warp_mca.results.csv_table import write_table
from warp_mca.results.npz import load_histories, save_histories
from warp_mca.results.units import units_of
from warp_mca.scene import Scene

Array = NDArray[np.float64]
Rows = NDArray[np.integer] | NDArray[np.bool_] | slice

NPZ, CSV = "probes.npz", "probes.csv"
UNEVEN = "give rows of one spacing, as those of an impact"


@dataclass(frozen=True, kw_only=True)
class ProbeHistory:
    """Motion of one probe at the end of each output interval, in the world frame.

    Attributes:
        name: of the probe.
        time: of each row [s], shape (row_count,), float64.
        position: [m], shape (row_count, 3), float64.
        velocity: [m/s], shape (row_count, 3), float64.
        cfc: channel frequency class that the scene asks for [Hz], or None.
        begins: whether a phase begins with each row, bool, shape (row_count,).
    """

    name: str
    time: Array
    position: Array
    velocity: Array
    cfc: float | None = None
    begins: NDArray[np.bool_]

    @property
    def acceleration(self) -> Array:
        """Change of the velocity over each output interval [m/s^2], shape (row_count, 3): its mean there, raw.

        Its sum times the interval is exactly the change of the velocity in a phase. The first row of a phase ends no
        interval and is 0: parts that were bolted at rest may fall from then on.
        """
        found = np.zeros_like(self.velocity)
        np.divide(np.diff(self.velocity, axis=0), np.diff(self.time)[:, None], out=found[1:])
        found[self.begins] = 0.0
        return found

    def filtered(self, cfc: float | None = None) -> Array:
        """Acceleration by the filter of SAE J211 [m/s^2], shape (row_count, 3), see `cfc_filter`.

        Each phase is filtered by itself; one with rows too far apart for the class, or uneven, has no numbers.

        Args:
            cfc: channel frequency class [Hz]; that of the scene if None.

        Raises:
            RequestError: no class is given, or it can be had of no phase.
        """
        chosen = self.cfc if cfc is None else cfc
        if chosen is None:
            raise bad_value("cfc", None, "give the channel frequency class, as 60, 180, 600 or 1000 Hz")
        raw, found, refused = self.acceleration, np.full_like(self.velocity, np.nan), None
        phases = np.split(np.arange(len(self.time)), np.flatnonzero(self.begins[1:]) + 1)
        for rows in phases:
            try:
                found[rows] = self._filtered(raw[rows], self.time[rows], chosen)
            except RequestError as error:
                refused = error
        if refused and np.isnan(found).all():
            raise refused
        return found

    def _filtered(self, raw: Array, time: Array, cfc: float) -> Array:
        """Acceleration of one phase by the filter.

        Raises:
            RequestError: rows are too far apart for it, or not even.
        """
        if len(time) < 2:  # a guard stopped the run at once
            return raw
        if not is_even(time):
            raise bad_value(f"probe {self.name}: time between rows", "uneven", UNEVEN)
        return cfc_filter(raw, float(time[-1] - time[0]) / (len(time) - 1), cfc)

    @property
    def own_filtered(self) -> Array | None:
        """Acceleration filtered as the scene asks [m/s^2], or None: it does not, or it can be had of no phase."""
        try:
            return None if self.cfc is None else self.filtered()
        except RequestError:
            return None

    def at(self, rows: Rows) -> ProbeHistory:
        """The same in some output intervals: a slice, numbers (count,), or whether each is one of them (row_count,)."""
        time, begins = self.time[rows], self.begins[rows].copy()
        begins[:1] = True
        return replace(self, time=time, position=self.position[rows], velocity=self.velocity[rows], begins=begins)


@dataclass(frozen=True, kw_only=True)
class SectionHistory:
    """Resultant of one section at the end of each output interval, in the world frame.

    Attributes:
        name: of the section.
        force: of the side to which its normal points on the other [N], shape (row_count, 3), float64.
        moment: of that about the mean place of the nodes in the section [N m], shape (row_count, 3), float64.
    """

    name: str
    force: Array
    moment: Array

    def at(self, rows: Rows) -> SectionHistory:
        """The same in some output intervals, as `ProbeHistory.at`."""
        return replace(self, force=self.force[rows], moment=self.moment[rows])


Sensors = tuple[tuple[ProbeHistory, ...], tuple[SectionHistory, ...]]


def sensor_histories(scene: Scene, time: Array, records: Sequence[Array], counts: Sequence[int]) -> Sensors:
    """What the probes and the sections of a scene recorded.

    Args:
        scene: whose they are.
        time: of each row [s], shape (row_count,).
        records: of each row, as `SceneRecords.sensors` has them.
        counts: of the rows of each phase.
    """
    count = len(scene.probes) + len(scene.sections)
    if not count:
        return (), ()
    parts = np.array(records).reshape(len(time), count, 2, 3)
    begins = np.isin(np.arange(len(time)), np.cumsum([0, *counts]))
    probes = (
        ProbeHistory(
            name=probe.name,
            time=time,
            position=parts[:, k, 0],
            velocity=parts[:, k, 1],
            cfc=probe.cfc,
            begins=begins,
        )
        for k, probe in enumerate(scene.probes)
    )
    sections = (
        SectionHistory(name=section.name, force=parts[:, k, 0], moment=parts[:, k, 1])
        for k, section in enumerate(scene.sections, len(scene.probes))
    )
    return tuple(probes), tuple(sections)


def sensor_columns(probes: Sequence[ProbeHistory], sections: Sequence[SectionHistory]) -> dict[str, tuple[Array, str]]:
    """Columns of probes.csv but for the time, each shape (row_count,), and their units, by name."""
    found: dict[str, tuple[Array, str]] = {}

    def add(name: str, letter: str, vectors: Array, unit: str, ending: str = "") -> None:
        for k, axis in enumerate("xyz"):
            found[f"{name}.{letter}{axis}{ending}"] = vectors[:, k], unit

    for probe in probes:
        add(probe.name, "", probe.position, "m")
        add(probe.name, "v", probe.velocity, "m/s")
        add(probe.name, "a", probe.acceleration, "m/s^2")
        if (smooth := probe.own_filtered) is not None:
            add(probe.name, "a", smooth, "m/s^2", f"_cfc{probe.cfc:g}")
    for section in sections:
        add(section.name, "F", section.force, "N")
        add(section.name, "M", section.moment, "N m")
    return found


def sensor_figures(
    probes: Sequence[ProbeHistory], sections: Sequence[SectionHistory], history: Mapping[str, Array]
) -> dict[str, Any]:
    """What the summary says of units, and of probes and sections where there are any.

    Args:
        probes, sections: of the run.
        history: its columns.
    """
    own = {name: unit for name, (_, unit) in sensor_columns(probes, sections).items()}
    found: dict[str, Any] = {"units": units_of(history) | own}
    time = history["time_s"]
    if probes:
        found["probes"] = [_probe_figures(probe) for probe in probes]
    if sections:
        found["sections"] = [
            {"name": s.name, **_greatest("F_max", s.force, time), **_greatest("M_max", s.moment, time)}
            for s in sections
        ]
    return found


def _probe_figures(probe: ProbeHistory) -> dict[str, Any]:
    raw = _greatest("acceleration_max", probe.acceleration, probe.time)
    found = {"name": probe.name, **raw, **_greatest("velocity_max", probe.velocity, probe.time)}
    way = probe.position[-1] - probe.position[0] if len(probe.position) else np.zeros(3)
    found["displacement_end"] = way.tolist()
    if (smooth := probe.own_filtered) is not None:
        found |= {"cfc": probe.cfc, **_greatest("acceleration_cfc_max", smooth, probe.time)}
    return found


def _greatest(key: str, vectors: Array, time: Array) -> dict[str, Any]:
    """The longest of some vectors and its time; None without vectors."""
    size = np.nan_to_num(np.linalg.norm(vectors, axis=1))
    if not size.any():
        return {key: 0.0, f"{key}_time": None}
    k = int(size.argmax())
    return {key: float(size[k]), f"{key}_time": float(time[k])}


def save_sensors(folder: Path, time: Array, probes: Sequence[ProbeHistory], sections: Sequence[SectionHistory]) -> None:
    """Write probes.npz and probes.csv.

    The archive has time_s; of each probe NAME/position_m, NAME/velocity, NAME/acceleration (raw), NAME/cfc, nan for
    none, and NAME/begins, true where a phase begins; of each section NAME/force_N and NAME/moment_Nm. The table has the
    columns of `sensor_columns`.
    """
    histories: dict[str, Mapping[str, NDArray]] = {
        probe.name: {
            "position_m": probe.position,
            "velocity": probe.velocity,
            "acceleration": probe.acceleration,
            "cfc": np.array(np.nan if probe.cfc is None else probe.cfc),
            "begins": probe.begins,
        }
        for probe in probes
    }
    histories |= {s.name: {"force_N": s.force, "moment_Nm": s.moment} for s in sections}
    save_histories(folder / NPZ, time, histories)
    write_table(folder / CSV, {"time_s": time, **{n: c for n, (c, _) in sensor_columns(probes, sections).items()}})


def load_sensors(file: str | os.PathLike[str]) -> Sensors:
    """The probes and sections of a probes.npz."""
    with np.load(file) as arrays:
        time = arrays["time_s"]
    begins = {name: rows for name, (rows,) in load_histories(file, "begins").items()}  # not of earlier versions
    probes = (
        ProbeHistory(
            name=name,
            time=time,
            position=position,
            velocity=velocity,
            cfc=None if np.isnan(cfc) else float(cfc),
            begins=begins[name] if name in begins else np.arange(len(time)) == 0,
        )
        for name, (position, velocity, cfc) in load_histories(file, "position_m", "velocity", "cfc").items()
    )
    sections = (
        SectionHistory(name=name, force=force, moment=moment)
        for name, (force, moment) in load_histories(file, "force_N", "moment_Nm").items()
    )
    return tuple(probes), tuple(sections)
