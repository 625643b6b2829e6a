"""Owns what a run leaves behind: `Result`, its summary, and the folder it is saved in and loaded from."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from warp_mca.contact_history import ContactHistory, load_contacts, save_contacts
from warp_mca.errors import McaError, RequestError, bad_value
from warp_mca.files import check_folder, given_path, nearest
from warp_mca.history import Array, contact_intervals, force_peaks, reverses, stick_intervals, unfinished
from warp_mca.paths import PathHistory, load_paths, save_paths
from warp_mca.validate import DAMAGE

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
FILES = ("summary.json", "history.csv", "forces.png", "energies.png")
CONTACT_FILES = ("forces.npz",)  # of scenes with contacts, besides
PATH_FILES = ("paths.npz", "paths.png", "waves.png")  # of scenes with paths, besides
ALL_FILES = FILES + CONTACT_FILES + PATH_FILES
STAGING = ".warp_mca-"  # begins the names of folders that results are written in at first
LONGEST_SAVE = 3600.0  # far more than any takes [s]


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
    """

    summary: dict[str, Any]
    history: dict[str, Array]
    path: Path | None = None
    warnings: tuple[str, ...] = ()
    paths: tuple[PathHistory, ...] = ()
    stopped: str | None = None
    failed: tuple[str, ...] = ()
    contacts: tuple[ContactHistory, ...] = ()

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

    def __getitem__(self, column: str) -> Array:
        """The history column of that name, shape (row_count,)."""
        if column not in self.history:
            raise KeyError(f"{column}: the history has {', '.join(self.history)}")
        return self.history[column]


@dataclass(frozen=True, kw_only=True)
class RunFacts:
    """What the simulation alone knows and the summary reports. What a scene lacks is None.

    Attributes:
        scene: its name.
        n_elements, n_nodes: size of the model.
        dt: time step [s].
        n_steps: finite-element steps done.
        simulated_time: of the impact phase [s].
        wall: wall-clock seconds by stage: rigid, mesh, compile, fe, output.
        device, precision, element: what it ran on and with.
        energy_error: largest imbalance as a share of initial energy and external work [-].
        energy: ledger at the end [J].
        max_plastic_strain: greatest equivalent plastic strain [-].
        parameters: of the scene.
        t_contact: when the rigid phase ended [s].
        v_n, v_t: velocity of the tip's centre at hand-off [m/s], downwards and along +x.
        theta, theta_dot: of the links at hand-off [rad], [rad/s].
        more: further figures, added to the summary as they are.
    """

    scene: str
    n_elements: int
    n_nodes: int
    dt: float
    n_steps: int
    simulated_time: float
    wall: Mapping[str, float]
    device: str
    precision: str
    element: str
    energy_error: float
    energy: Mapping[str, float]
    max_plastic_strain: float
    parameters: Mapping[str, object] = field(default_factory=dict)
    t_contact: float | None = None
    v_n: float | None = None
    v_t: float | None = None
    theta: tuple[float, ...] = ()
    theta_dot: tuple[float, ...] = ()
    more: Mapping[str, object] = field(default_factory=dict)


def summarise(history: Mapping[str, Array], facts: RunFacts, pairs: Sequence[ContactHistory] = ()) -> dict[str, Any]:
    """The contents of `summary.json`: `facts`, and what is read off the history.

    Args:
        history: by column, see `HISTORY_COLUMNS`.
        facts: of the run.
        pairs: the scene's contacts, each by itself.
    """
    from warp_mca import __version__

    time, F_n, F_t = history["time_s"], history["F_n_N"], history["F_t_N"]
    contacts = contact_intervals(time, F_n)
    peaks = force_peaks(time, F_n)
    known = {f.name: getattr(facts, f.name) for f in fields(facts) if f.name != "more"}
    fe_wall = facts.wall.get("fe", 0.0)
    return {
        **known,
        "wall": dict(facts.wall),
        "energy": dict(facts.energy),
        "parameters": dict(facts.parameters),
        "theta": list(facts.theta),
        "theta_dot": list(facts.theta_dot),
        "F_n_first_peak": peaks[0][1] if peaks else None,
        "F_n_peaks": [list(peak) for peak in peaks],
        "F_n_max": float(np.max(F_n, initial=0.0)),
        "F_t_min": float(np.min(F_t, initial=0.0)),
        "F_t_max": float(np.max(F_t, initial=0.0)),
        "F_t_reverses": reverses(F_t),
        "contacts": [list(contact) for contact in contacts],
        "contact_duration": sum(end - start for start, end in contacts),
        "touched": bool(contacts) or any(pair.touched for pair in pairs),
        "contact_open_at_end": unfinished(F_n) or any(pair.unfinished for pair in pairs),
        "contacts_by_pair": [pair.summary(time) for pair in pairs],
        "sticks": [list(stick) for stick in stick_intervals(time, F_n, history["stick_fraction"])],
        "element_steps_per_s": facts.n_elements * facts.n_steps / fe_wall if fe_wall > 0.0 else None,
        "version": __version__,
        **facts.more,
    }


def check_output(directory: str | os.PathLike[str], *, force: bool = False) -> Path:
    """The folder as a path, when results may be written there.

    Raises:
        RequestError: it is a file, cannot be written to, or holds results and `force` is off.
    """
    path = folder_path("out", directory)
    check_folder("out", path)
    if not force and any((path / name).exists() for name in ALL_FILES):
        raise _taken(path)
    return path


def _taken(path: Path) -> RequestError:
    return bad_value("out", str(path), "it holds results already; name another folder, or use --force (force=True)")


def save(result: Result, directory: str | os.PathLike[str], *, force: bool = False) -> Result:
    """Write summary.json, history.csv and the figures, all or none of them.

    Args:
        result: of a run.
        directory: is made if need be.
        force: replace results that are there already.

    Returns:
        The result with its `path` set, and with the time that writing took in wall.output.

    Raises:
        RequestError: as in `check_output`; also where another run saves to the folder at the same time and is first.
        McaError: the disk is full or fails.
    """
    from warp_mca.report.energies import save_energies
    from warp_mca.report.forces import save_forces
    from warp_mca.report.paths import save_path_figures

    path = check_output(directory, force=force)
    # Written beside the folder first: a run that fails or is killed half-way leaves nothing behind.
    staging = None
    try:
        staging = Path(tempfile.mkdtemp(prefix=STAGING, dir=nearest(path)))
        written = staging / "results"
        written.mkdir()
        begun = time.perf_counter()
        _write_history(written / "history.csv", result.history)
        save_forces(written / "forces.png", result)
        save_energies(written / "energies.png", result)
        if result.contacts:
            save_contacts(written / "forces.npz", result.time, result.contacts)
        if result.paths:
            save_paths(written / "paths.npz", result.time, result.paths)
            save_path_figures(written, result)
        result = _with_output_time(result, path, time.perf_counter() - begun)
        summary = {**result.summary, "warnings": list(result.warnings)}
        (written / "summary.json").write_text(json.dumps(summary, indent=2, default=_plain) + "\n", encoding="utf-8")
        _move(written, path, force)
        _clear(path)
    except OSError as error:
        raise McaError(f"the results could not be written to {path}: {error.strerror or error}") from error
    finally:
        if staging:
            shutil.rmtree(staging, ignore_errors=True)
    return result


def _move(written: Path, path: Path, force: bool) -> None:
    """Move the folder `written` to `path`: at once where there is none yet, otherwise file by file.

    Raises:
        RequestError: another run was first.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        with suppress(OSError):  # another run made it meanwhile
            written.rename(path)
            return
    path.mkdir(exist_ok=True)
    if not force:
        _claim(path)
    for name in ALL_FILES:
        if (written / name).exists():
            (written / name).replace(path / name)
        else:  # left by a run of another scene
            (path / name).unlink(missing_ok=True)


def _claim(path: Path) -> None:
    """Make the first file of results in a folder, empty: of several runs only one can.

    Raises:
        RequestError: another run was first.
    """
    try:
        (path / FILES[0]).open("x").close()
    except FileExistsError as error:
        raise _taken(path) from error


def _clear(path: Path) -> None:
    """Remove what is left in a folder by runs that were killed while they saved."""
    for folder in path.glob(f"{STAGING}*"):
        with suppress(OSError):
            if time.time() - folder.stat().st_mtime > LONGEST_SAVE:
                shutil.rmtree(folder, ignore_errors=True)


def load(directory: str | os.PathLike[str]) -> Result:
    """The result that a run saved in `directory`.

    Raises:
        RequestError: there is none, or its files cannot be read.
    """
    path = folder_path("results", directory)
    try:
        summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
        warnings = tuple(summary.pop("warnings", ()))
        history = _read_history(path / "history.csv")
        paths = load_paths(path / "paths.npz") if (path / "paths.npz").exists() else ()
        contacts = load_contacts(path / "forces.npz") if (path / "forces.npz").exists() else ()
    except FileNotFoundError as error:
        raise bad_value("results", str(path), f"it has no {Path(error.filename).name}; name a run's folder") from error
    except DAMAGE as error:
        raise bad_value("results", str(path), "its files are damaged; run again") from error
    return Result(summary, history, path, warnings, paths, contacts=contacts)


def folder_path(field: str, directory: object) -> Path:
    """The folder that the user named `field`.

    Raises:
        RequestError: it is no path.
    """
    return given_path(field, directory, "name a folder, or . for this one")


def _read_history(path: Path) -> dict[str, Array]:
    """The columns of history.csv.

    Raises:
        ValueError: it has other columns than a run writes, no rows, or no end.
        OSError: it cannot be read, or is empty.
    """
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        whole = file.read() == b"\n"
    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().split(",")
        if not (whole and tuple(names[: len(HISTORY_COLUMNS)]) == HISTORY_COLUMNS and len(set(names)) == len(names)):
            raise ValueError(names)
        first = file.readline()
        if not first:
            raise ValueError("no rows")
        rows = np.loadtxt(chain([first], file), delimiter=",", dtype=np.float64, comments=None, ndmin=2)
        rows = rows.reshape(-1, len(names))
    return dict(zip(names, rows.T.copy(), strict=True))


def _with_output_time(result: Result, path: Path, seconds: float) -> Result:
    """The result as saved in `path`, with the time that writing it took added to wall.output."""
    summary = dict(result.summary)
    wall = summary.get("wall")
    if isinstance(wall, Mapping):
        summary["wall"] = {**wall, "output": wall.get("output", 0.0) + seconds}
    return dataclasses.replace(result, summary=summary, path=path)


def _write_history(path: Path, history: Mapping[str, Array]) -> None:
    missing = [name for name in HISTORY_COLUMNS if name not in history]
    if missing:
        raise RequestError(f"history: the columns {', '.join(missing)} are missing; give every one of HISTORY_COLUMNS")
    names = [*HISTORY_COLUMNS, *(name for name in history if name not in HISTORY_COLUMNS)]
    rows = np.column_stack([np.asarray(history[name], dtype=np.float64) for name in names])
    # repr gives the shortest text that reads back as the same float64.
    lines = [",".join(names), *(",".join(map(repr, row)) for row in rows.tolist())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _plain(value: object) -> object:
    """NumPy numbers and arrays, tuples and mappings as JSON knows them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    return str(value)
