"""Owns the runs of a level: it carries them out in one sweep, and finds the result of each by study and value."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from warp_mca.paper.studies import MAIN, STUDIES, Case, Key, Level, cases, in_order
from warp_mca.phases.arguments import Progress
from warp_mca.results.result import Result
from warp_mca.results.storage import load
from warp_mca.step.device import devices_named
from warp_mca.studies.sweep import carry_out, stored_rows
from warp_mca.studies.sweep_job import DONE, Row
from warp_mca.studies.sweep_plan import Plan, RunOptions, differing, run_name
from warp_mca.studies.worker_process import Prepare

RUNS = "runs"  # folder of the sweep
SHARE = 3  # runs that share a GPU: most of a run's time goes to meshes, assembly, figures and files, on the host


class MissingRunError(Exception):
    """A figure needs a run that the level leaves out, or that failed; says which and why."""


@dataclass(frozen=True)
class Runs:
    """All runs of a level, finished.

    Attributes:
        level: that was run.
        out: folder of the report.
        cases: what was run, by study, value and variant.
        rows: of the sweep's table, by case.
        folders: with the files of each run, by case.
        device: that commands name.
        comparison: with finite elements alone, as `table_2.compare` gives it; None if they were not run.
        pure: folder of that comparison.
    """

    level: Level
    out: Path
    cases: Mapping[Key, Case]
    rows: Mapping[Case, Row]
    folders: Mapping[Case, Path]
    device: str
    comparison: Mapping[str, Any] | None = None
    pure: Path = Path()


@dataclass(frozen=True)
class Evidence:
    """What claims and figures are read from: the runs of one variant."""

    runs: Runs
    variant: str = MAIN

    def run(self, study: str, value: float) -> Result:
        """The result of a run.

        Raises:
            MissingRunError: there is none.
        """
        case = self.runs.cases.get((study, value, self.variant))
        if case is None:
            raise MissingRunError(f"{_title(study)}: {value:g} is not run at this level")
        row = self.runs.rows[case]
        if row["status"] != DONE:
            raise MissingRunError(f"{_title(study)}, {value:g}: {row['reason']}")
        return _loaded(self.runs.folders[case])

    def values(self, study: str) -> list[float]:
        """Values whose runs were finished, ascending.

        Raises:
            MissingRunError: there are fewer than two.
        """
        keys = [key for key in self.runs.cases if key[0] == study and key[2] == self.variant]
        found = sorted(v for s, v, variant in keys if self.runs.rows[self.runs.cases[s, v, variant]]["status"] == DONE)
        if len(found) < 2:
            raise MissingRunError(f"{_title(study)}: fewer than two runs at this level")
        return found

    def comparison(self) -> dict[str, Any]:
        """What `table_2.compare` found; of the variant MAIN only.

        Raises:
            MissingRunError: finite elements alone were not run.
        """
        if self.runs.comparison is None or self.variant != MAIN:
            raise MissingRunError("pure finite elements are run with --pure-fem only")
        return dict(self.runs.comparison)

    def compared(self, name: str) -> Result:
        """One of the results that were compared, by the name of its folder.

        Raises:
            MissingRunError: as in `comparison`.
        """
        self.comparison()
        return _loaded(self.runs.pure / name)

    def results(self, study: str) -> list[Result]:
        """Results of all values, in their order.

        Raises:
            MissingRunError: there are fewer than two.
        """
        return [self.run(study, value) for value in self.values(study)]


def _title(study: str) -> str:
    return STUDIES[study].title if study in STUDIES else study


@lru_cache(maxsize=16)
def _loaded(folder: Path) -> Result:
    return load(folder)


def carry_out_runs(
    level: Level,
    out: Path,
    *,
    device: str = "cpu",
    precision: str = "mixed",
    workers: int | None = None,
    force: bool = False,
    prepare: Prepare | None = None,
    progress: Progress | None = None,
    deadline: float = math.inf,
) -> Runs:
    """Run what `out` does not hold yet of a level.

    Args:
        level: to be run.
        out: folder of the report; runs are in a folder of it.
        device, precision, force, prepare, progress: as in `warp_mca.sweep`.
        workers: number of processes; one for each core, or SHARE for each GPU, if None.
        deadline: no run begins later than this after the call [s]; with 0 no device is needed.

    Raises:
        RequestError, McaError: as in `warp_mca.sweep`; `out` holds runs of another level, among others.
    """
    found = cases(level)
    unique: Sequence[Case] = in_order(level, found)
    scenes = tuple(case.scene() for case in unique)
    folder = out / RUNS
    # each run is a model of its own, so that the command of its row gives the same figures
    plan = Plan(scenes, differing(scenes), RunOptions(device, precision), None, folder, folders=True, batch=1)
    if deadline > 0.0:
        workers = workers or (None if device == "cpu" else SHARE * len(devices_named(device)))
        options: dict[str, Any] = {"workers": workers, "force": force, "prepare": prepare, "progress": progress}
        rows = carry_out(plan, **options, deadline=deadline)
    else:
        rows = stored_rows(plan)
    folders = {case: folder / run_name(k, len(unique)) for k, case in enumerate(unique)}
    return Runs(level, out, found, dict(zip(unique, rows, strict=True)), folders, device)


def figures_of(row: Row) -> dict[str, Any]:
    """A row of the sweep without its number and what clocks decide."""
    left_out = ("index", "wall", "element_steps_per_s")
    return {key: value for key, value in row.items() if key not in left_out and value is not None}
