"""Owns the folder of a run's results: what is written there, when it may be, and how it is read back."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path

import numpy as np

from warp_mca.base.errors import McaError, RequestError, bad_value
from warp_mca.base.files import check_folder, given_path
from warp_mca.base.folder import Folder, held
from warp_mca.base.validate import DAMAGE
from warp_mca.results.contact_history import load_contacts, save_contacts
from warp_mca.results.csv_table import write_table
from warp_mca.results.drawing import draw_figures
from warp_mca.results.force_history import Array
from warp_mca.results.html_page import Image
from warp_mca.results.paths import load_paths, save_paths
from warp_mca.results.report import REPORT, report_html
from warp_mca.results.result import HISTORY_COLUMNS, Result
from warp_mca.results.sensor_history import CSV, NPZ, load_sensors, save_sensors

FILES = ("summary.json", "history.csv", "forces.png", "energies.png", REPORT)
CONTACT_FILES = ("forces.npz",)  # of scenes with contacts, besides
PATH_FILES = ("paths.npz", "paths.png", "waves.png")  # of scenes with paths, besides
PROBE_FILES = (NPZ, CSV, "probes.png")  # of scenes with probes or sections, besides
ALL_FILES = FILES + CONTACT_FILES + PATH_FILES + PROBE_FILES
DATA = ("history.csv", *CONTACT_FILES, "paths.npz", NPZ, CSV)  # the others are figures
DIGESTS = "files"  # key of summary.json: SHA-256 of each other file of the run, by its name


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
    """Write summary.json, history.csv, the figures and report.html, all or none of them.

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


def write(
    result: Result,
    folder: Folder,
    *,
    force: bool = False,
    images: Callable[[], Sequence[Image]] = tuple,
    figures: bool = True,
) -> Result:
    """As `save`, to a folder that is held already; `images` draws those of the bodies for the report.

    Without `figures` nothing is drawn, and the report has tables alone.
    """
    path = folder.path
    try:
        folder.renew()
        _check_free(path, force)
        with folder.staging() as staging:
            written = staging / "results"
            written.mkdir()
            begun = time.perf_counter()
            _write_data(result, written)
            if figures:
                draw_figures(result, written)
            text = report_html(result, written, images() if figures else ())
            (written / REPORT).write_text(text, encoding="utf-8")
            digests = {file.name: _digest(file) for file in sorted(written.iterdir())}
            result = _with_output_time(result, path, time.perf_counter() - begun)
            summary = {**result.summary, "warnings": list(result.warnings), DIGESTS: digests}
            text = json.dumps(summary, indent=2, default=_plain)
            (written / "summary.json").write_text(text + "\n", encoding="utf-8")
            folder.put(written, ALL_FILES)
    except OSError as error:
        raise McaError(f"the results could not be written to {path}: {error.strerror or error}") from error
    return result


def _write_data(result: Result, folder: Path) -> None:
    """Write the histories."""
    _write_history(folder / "history.csv", result.history)
    if result.contacts:
        save_contacts(folder / "forces.npz", result.time, result.contacts)
    if result.paths:
        save_paths(folder / "paths.npz", result.time, result.paths)
    if result.probes or result.sections:
        save_sensors(folder, result.time, result.probes, result.sections)


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
        sensors = load_sensors(path / NPZ) if (path / NPZ).exists() else ((), ())
        strange = _not_of_the_run(path, digests)
    except FileNotFoundError as error:
        raise bad_value("results", str(path), f"it has no {Path(error.filename).name}; name a run's folder") from error
    except DAMAGE as error:
        raise bad_value("results", str(path), "its files are damaged; run again") from error
    if strange:
        gone = not (path / strange).exists()
        what = "is gone, though summary.json lists it" if gone else "was changed, or is not of the run of summary.json"
        raise bad_value("results", str(path), f"{strange} {what}; run again")
    return Result(summary, history, path, warnings, paths, contacts=contacts, probes=sensors[0], sections=sensors[1])


def _not_of_the_run(path: Path, digests: Mapping[str, str] | None) -> str:
    """Name of the first data file in `path` that does not match the `digests` of the run; "" if all match.

    Figures may be removed, because nothing is read from them.
    """
    if digests is None:  # results of an earlier version
        return ""
    present = {name: path / name for name in DATA if name in digests or (path / name).exists()}
    return next((n for n, file in present.items() if not file.exists() or digests.get(n) != _digest(file)), "")


def folder_path(field: str, directory: object) -> Path:
    """The folder given for the option `field`.

    Raises:
        RequestError: it is not a path.
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
    """The result with its `path`, and with the time of writing added to wall.output."""
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
    write_table(path, {name: history[name] for name in names})


def _plain(value: object) -> object:
    """NumPy numbers and arrays, tuples and mappings as JSON knows them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    return str(value)
