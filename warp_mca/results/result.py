"""Owns what a run leaves behind: `Result`, its summary, and the folder it is saved in and loaded from."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from warp_mca.base.errors import McaError, RequestError, bad_value
from warp_mca.base.files import check_folder, given_path
from warp_mca.base.folder import Folder, held
from warp_mca.base.validate import DAMAGE
from warp_mca.results.contact_history import ContactHistory, load_contacts, save_contacts
from warp_mca.results.force_history import Array, contact_intervals, force_peaks, reverses, stick_intervals, unfinished
from warp_mca.results.paths import PathHistory, load_paths, save_paths

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
DIGESTS = "files"  # key of summary.json: SHA-256 of each other file of the run, by its name


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
    _check_free(path, force)
    return path


def _check_free(path: Path, force: bool) -> None:
    for name in ALL_FILES:
        if (path / name).is_dir():
            raise bad_value("out", str(path), f"{name} is a folder there; name another folder")
        if not force and (path / name).exists():
            remedy = "it holds results already; name another folder, or use --force (force=True)"
            raise bad_value("out", str(path), remedy)


@contextmanager
def hold(directory: str | os.PathLike[str], *, force: bool = False) -> Iterator[Folder]:
    """Hold the folder of a run's results from its start to its end; it is made if need be.

    Raises:
        RequestError: as in `check_output`; or another run holds it.
    """
    with held(check_output(directory, force=force)) as folder:
        _check_free(folder.path, force)  # another run may have saved there between check and lock
        yield folder


def save(result: Result, directory: str | os.PathLike[str], *, force: bool = False) -> Result:
    """Write summary.json, history.csv and the figures, all or none of them.

    Args:
        result: of a run.
        directory: is made if need be.
        force: replace results that are there already; other files stay.

    Returns:
        The result with its `path` set, and with the time that writing took in wall.output.

    Raises:
        RequestError: as in `check_output`; or another run writes to the folder.
        McaError: the disk is full or fails.
    """
    with hold(directory, force=force) as folder:
        return write(result, folder, force=force)


def write(result: Result, folder: Folder, *, force: bool = False) -> Result:
    """As `save`, to a folder that is held already."""
    from warp_mca.report.energies import save_energies
    from warp_mca.report.forces import save_forces
    from warp_mca.report.paths import save_path_figures

    path = folder.path
    try:
        folder.renew()
        _check_free(path, force)
        with folder.staging() as staging:
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
            digests = {file.name: _digest(file) for file in sorted(written.iterdir())}
            result = _with_output_time(result, path, time.perf_counter() - begun)
            summary = {**result.summary, "warnings": list(result.warnings), DIGESTS: digests}
            text = json.dumps(summary, indent=2, default=_plain)
            (written / "summary.json").write_text(text + "\n", encoding="utf-8")
            folder.put(written, ALL_FILES)
    except OSError as error:
        raise McaError(f"the results could not be written to {path}: {error.strerror or error}") from error
    return result


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def load(directory: str | os.PathLike[str]) -> Result:
    """The result that a run saved in `directory`.

    Raises:
        RequestError: there is none, its files cannot be read, or they are of different runs.
    """
    path = folder_path("results", directory)
    try:
        summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
        warnings, digests = tuple(summary.pop("warnings", ())), summary.pop(DIGESTS, None)
        history = _read_history(path / "history.csv")
        paths = load_paths(path / "paths.npz") if (path / "paths.npz").exists() else ()
        contacts = load_contacts(path / "forces.npz") if (path / "forces.npz").exists() else ()
        strange = _of_other_runs(path, digests)
    except FileNotFoundError as error:
        raise bad_value("results", str(path), f"it has no {Path(error.filename).name}; name a run's folder") from error
    except DAMAGE as error:
        raise bad_value("results", str(path), "its files are damaged; run again") from error
    if strange:
        remedy = f"{strange[0]} was changed, or is not of the run that summary.json is of; run again"
        raise bad_value("results", str(path), remedy)
    return Result(summary, history, path, warnings, paths, contacts=contacts)


def _of_other_runs(path: Path, digests: Mapping[str, str] | None) -> list[str]:
    """Names of the files with data in `path` that differ from those of the run whose `digests` these are."""
    if digests is None:  # results of an earlier version
        return []
    found = [name for name in ("history.csv", "forces.npz", "paths.npz") if (path / name).exists()]
    return [name for name in found if digests.get(name) != _digest(path / name)]


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
