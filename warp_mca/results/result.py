"""Owns `Result`, the outcome of a run, and the figures of its summary."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from warp_mca.base.errors import bad_value
from warp_mca.base.version import __version__
from warp_mca.results.contact_history import ContactHistory
from warp_mca.results.force_history import Array, contact_intervals, force_peaks, reverses, stick_intervals, unfinished
from warp_mca.results.paths import PathHistory
from warp_mca.results.sensor_history import ProbeHistory, SectionHistory

HISTORY_COLUMNS = (
    "time_s",
    "F_n_N",
    "F_t_N",
    "stick_fraction",
    "tip_vx",
    "tip_vy",
    "plate_vx",
    "E_kinetic",
    "E_internal",
    "E_plastic",
    "E_contact",
    "E_friction",
    "E_total_error",
)  # of every history.csv; a run adds some, see docs/outputs.md
FACTS = (  # of every summary.json, before what is read off the history; None or empty where a scene lacks them
    *("scene", "n_elements", "n_nodes", "dt", "n_steps", "simulated_time", "wall", "device", "precision", "element"),
    *("energy_error", "energy", "max_plastic_strain", "parameters", "t_contact", "v_n", "v_t", "theta", "theta_dot"),
)


@dataclass(frozen=True)
class Result:
    """A finished run.

    Attributes:
        summary: the figures of `summary.json`, see `summarise`.
        history: one array for each column of `history.csv`, each shape (row_count,), float64.
        path: folder that it was saved in or loaded from, or None.
        warnings: what the run noticed without stopping, one sentence each.
        paths: stress along the scene's paths, with one row for each row of the history.
        contacts: forces of each of the scene's contacts by itself, with one row for each row of the history.
        stopped: which guard stopped this scene of a batch, in one sentence; None if none did. Rows end before it.
        failed: names of recorders that failed: what they write is missing or ends too early.
        probes: motion of the scene's probes, with one row for each row of the history.
        sections: resultants of the scene's sections, likewise.
    """

    summary: dict[str, Any]
    history: dict[str, Array]
    path: Path | None = None
    warnings: tuple[str, ...] = ()
    paths: tuple[PathHistory, ...] = ()
    stopped: str | None = None
    failed: tuple[str, ...] = ()
    contacts: tuple[ContactHistory, ...] = ()
    probes: tuple[ProbeHistory, ...] = ()
    sections: tuple[SectionHistory, ...] = ()

    @property
    def time(self) -> Array:
        """Time after first contact [s], the end of each output interval, shape (row_count,)."""
        return self.history["time_s"]

    @property
    def F_n(self) -> Array:
        """Normal force on the slaves [N], mean over each output interval, shape (row_count,)."""
        return self.history["F_n_N"]

    @property
    def F_t(self) -> Array:
        """Tangential force on the slaves [N], mean over each output interval, shape (row_count,)."""
        return self.history["F_t_N"]

    def __repr__(self) -> str:
        """What ran and its main figures, in one line."""
        told = [f"{len(self.history.get('time_s', ()))} rows"]
        if (elements := self.summary.get("n_elements")) is not None:
            told.insert(0, f"{elements:,} elements")
        if (force := self.summary.get("F_n_max")) is not None:
            told.append(f"F_n up to {force:.4g} N")
        if (error := self.summary.get("energy_error")) is not None:
            told.append(f"energy error {error:.2g}")
        if self.warnings:
            told.append(f"{len(self.warnings)} warning{'s' if len(self.warnings) > 1 else ''}")
        if self.stopped:
            told.append("stopped by a guard")
        return f"<Result of {self.summary.get('scene', 'a run')}: {', '.join(told)}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the main figures, warnings and contact forces."""
        from warp_mca.results.notebook import result_html

        return result_html(self)

    def to_pandas(self) -> Any:
        """History, contacts, probes and sections as a `pandas.DataFrame`, with the time [s] as index.

        `attrs["units"]` has the unit of each column by its name. Columns beside those of `history`: CONTACT.Fx, .Fy,
        .Fz, .pressure and .closing_speed of each contact; those of probes.csv.

        Raises:
            RequestError: pandas is not installed.
        """
        from warp_mca.results.tables import to_pandas

        return to_pandas(self)

    def to_xarray(self) -> Any:
        """All that was recorded, stress along paths too, as an `xarray.Dataset` over the time [s].

        Each variable has its unit in `attrs["units"]`. contact_*, probe_* and section_* have a dimension of the names
        and one of the axes; stress_PATH one of the position along the path and one of the components.

        Raises:
            RequestError: xarray is not installed.
        """
        from warp_mca.results.tables import to_xarray

        return to_xarray(self)

    def to_parquet(self, file: str | os.PathLike[str]) -> Path:
        """Write the columns of `to_pandas` and the time to a Parquet file, the unit of each in its field's metadata.

        `pandas.read_parquet` gives them with `attrs["units"]`.

        Raises:
            RequestError: `file` is no path.
            McaError: it cannot be written.
        """
        from warp_mca.results.tables import to_parquet

        return to_parquet(self, file)

    def __getitem__(self, column: str) -> Array:
        """The history column of that name, shape (row_count,)."""
        if column not in self.history:
            raise KeyError(f"{column}: the history has {', '.join(self.history)}")
        return self.history[column]

    def impact(self, number: int = 0) -> Result:
        """The rows of one impact of a run of many phases, in time from its start; all rows of a run of one impact.

        Raises:
            RequestError: the run has no impact of that number, counted from 0.
        """
        if "phases" not in self.summary:
            return self
        spans = [(phase["start"], phase["end"]) for phase in self.summary["phases"] if phase["kind"] == "impact"]
        if not 0 <= number < len(spans):
            raise bad_value("number of an impact", number, f"the run has {len(spans)}, counted from 0")
        start, end = (t - spans[0][0] for t in spans[number])
        slack = 1e-9 * max(end, 1e-3)
        rows = (self.time >= start - slack) & (self.time <= end + slack)
        history = {name: column[rows] for name, column in self.history.items()}
        return replace(
            self,
            history={**history, "time_s": history["time_s"] - start},
            paths=tuple(path.at(rows) for path in self.paths),
            contacts=tuple(contact.at(rows) for contact in self.contacts),
            probes=tuple(replace(probe.at(rows), time=self.time[rows] - start) for probe in self.probes),
            sections=tuple(section.at(rows) for section in self.sections),
        )


def spring_extremes(history: Mapping[str, Array]) -> dict[str, Any]:
    """Greatest and least tension [N] and elongation [m] of each spring by name, under "springs"; empty without any."""
    names = [name.removeprefix("spring_").removesuffix("_N") for name in history if re.fullmatch("spring_.+_N", name)]
    found = {
        name: {
            f"{what}_{end}": float(least_or_greatest(history[f"spring_{name}_{unit}"]))
            for what, unit in (("force", "N"), ("elongation", "m"))
            for end, least_or_greatest in (("min", np.min), ("max", np.max))
        }
        for name in names
    }
    return {"springs": found} if found else {}


def bolt_extremes(history: Mapping[str, Array]) -> dict[str, Any]:
    """Greatest and least tension and greatest shear force of each bolt by name, under "bolts"; empty without any."""
    found: dict[str, Any] = {}
    for name in (name for name in history if re.fullmatch("bolt_.+_shear_N", name)):
        bolt = name.removeprefix("bolt_").removesuffix("_shear_N")
        tension, shear = history[f"bolt_{bolt}_N"], history[name]
        rows = {"max_force": (tension, tension.argmax()), "min_force": (tension, tension.argmin())}
        rows["max_shear"] = shear, shear.argmax()
        found[bolt] = {
            figure: {"value": float(values[k]), "unit": "N", "time": float(history["time_s"][k])}
            for figure, (values, k) in rows.items()
        }
    return {"bolts": found} if found else {}


def summarise(
    history: Mapping[str, Array], facts: Mapping[str, Any], pairs: Sequence[ContactHistory] = ()
) -> dict[str, Any]:
    """The contents of `summary.json`: `facts`, and what is read off the history.

    Args:
        history: by column, see `HISTORY_COLUMNS`.
        facts: figures of the run that the history does not hold, by key (docs/outputs.md), `n_elements`, `n_steps` and
            `wall`, the seconds by stage, among them.
        pairs: the scene's contacts, each by itself.
    """
    time, F_n, F_t = history["time_s"], history["F_n_N"], history["F_t_N"]
    contacts = contact_intervals(time, F_n)
    peaks = force_peaks(time, F_n)
    fe_wall = facts["wall"].get("fe", 0.0)
    given = {"parameters": {}, "theta": [], "theta_dot": [], **facts}
    return {
        **{key: given.get(key) for key in FACTS},
        "F_n_first_peak": peaks[0][1] if peaks else None,
        "F_n_peaks": [list(peak) for peak in peaks],
        "F_n_max": float(np.max(F_n, initial=0.0)),
        "F_t_min": float(np.min(F_t, initial=0.0)),
        "F_t_max": float(np.max(F_t, initial=0.0)),
        "F_t_reverses": reverses(F_t, F_n),
        "contacts": [list(contact) for contact in contacts],
        "contact_duration": sum(end - start for start, end in contacts),
        "touched": bool(contacts) or any(pair.touched for pair in pairs),
        "contact_open_at_end": unfinished(F_n) or any(pair.unfinished for pair in pairs),
        "contacts_by_pair": [pair.summary(time) for pair in pairs],
        "sticks": [list(stick) for stick in stick_intervals(time, F_n, history["stick_fraction"])],
        "element_steps_per_s": facts["n_elements"] * facts["n_steps"] / fe_wall if fe_wall > 0.0 else None,
        **spring_extremes(history),
        **bolt_extremes(history),
        "version": __version__,
        **{key: value for key, value in facts.items() if key not in FACTS},
    }
