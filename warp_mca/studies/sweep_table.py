"""Owns the table of a sweep: a row a run in sweep.csv, written as runs end, and the same in sweep.parquet."""

from __future__ import annotations

import json
import re
import textwrap
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from warp_mca.base.errors import LONGEST, McaError, bad_value
from warp_mca.base.files import write_atomically
from warp_mca.base.log import warn
from warp_mca.base.validate import MAX_COUNT
from warp_mca.results.report import REPORT
from warp_mca.results.storage import ALL_FILES
from warp_mca.studies.sweep_columns import stored_row
from warp_mca.studies.sweep_job import FAILED, Row
from warp_mca.studies.sweep_lines import header_of, line_of, read_lines
from warp_mca.studies.sweep_plan import run_name

CSV, PARQUET, IDENTITY = "sweep.csv", "sweep.parquet", "sweep.json"
PARQUET_INTERVAL = 5.0  # at least so long between two versions of the Parquet table while runs go on [s]


class SweepTable:
    """The rows of a sweep, in a folder or only in memory.

    `sweep.csv` grows by whole lines, in the order in which runs end; a line that a killed process left unfinished is
    dropped, and a damaged one is. New columns, and the order of runs at the end, replace the file by rename.

    Attributes:
        rows: by number of the run.
    """

    def __init__(self, folder: Path | None, parameters: Iterable[str] = ()) -> None:
        """Read the rows that `folder` has, if any, of a sweep with these parameters.

        Rows of failed runs are dropped, since these are run again, and so are rows of earlier versions in which a
        parameter has taken the place of a figure.

        Raises:
            RequestError: `sweep.csv` there is not of this form.
        """
        self.folder = folder
        self.rows: dict[int, Row] = {}
        self._columns: list[str] = []
        self._stored = 0.0
        if folder and (folder / CSV).exists():
            try:
                lines, damaged = read_lines(folder / CSV)
                found = [stored_row(row, parameters) for row in lines]
            except (ValueError, KeyError) as error:
                remedy = f"{CSV} there was changed by others; name another folder, or use --force (force=True)"
                raise bad_value("out", str(folder), remedy) from error
            if damaged:
                numbers = ", ".join(map(str, damaged))
                warn([f"{folder / CSV} is damaged in line {numbers}: the runs of these lines count as not done"])
            self.rows = {row["index"]: row for row in found if row and row["status"] != FAILED}
            self._columns = _columns(self.rows.values())
            self._rewrite()

    def add(self, rows: Sequence[Row]) -> None:
        """Take in rows of runs that have ended.

        Raises:
            McaError: they cannot be written.
        """
        self.rows |= {row["index"]: row for row in rows}
        if not self.folder:
            return
        if set().union(*rows) <= set(self._columns):
            lines = "".join(line_of(self._columns, row) for row in rows)
            with _writing(self.folder), (self.folder / CSV).open("ab", buffering=0) as file:
                file.write(lines.encode())  # one call: the lines are in the file whole, or not at all
        else:
            self._columns = _columns([dict.fromkeys(self._columns), *rows])
            self._rewrite()
        if time.monotonic() - self._stored > PARQUET_INTERVAL:
            self._write_parquet()

    def close(self) -> None:
        """Bring the files in the order of runs.

        Raises:
            McaError: they cannot be written.
        """
        self.rows = dict(sorted(self.rows.items()))
        if self.folder and self.rows:
            self._columns = _columns(self.rows.values())
            self._rewrite()
            self._write_parquet()

    def _rewrite(self) -> None:
        assert self.folder
        lines = [header_of(self._columns), *(line_of(self._columns, row) for row in self.rows.values())]
        text = "".join(lines).encode()
        with _writing(self.folder):
            write_atomically(self.folder / CSV, lambda file: file.write(text))

    def _write_parquet(self) -> None:
        assert self.folder
        try:
            import pyarrow as pa
            import pyarrow.parquet as pq
        except ImportError:
            warn([f"{PARQUET} needs the package pyarrow, which is not installed; {CSV} has all rows"])
            return
        rows = [row for _, row in sorted(self.rows.items())]
        table = pa.table({name: _alike([row.get(name) for row in rows]) for name in self._columns})

        def write(file: IO[bytes]) -> None:
            pq.write_table(table, file)

        with _writing(self.folder):
            write_atomically(self.folder / PARQUET, write)
        self._stored = time.monotonic()


def check_identity(folder: Path, identity: Mapping[str, object]) -> None:
    """Refuse a folder with rows of another sweep; the first that is found different is named.

    Raises:
        RequestError: so it is, or it cannot be told.
    """
    remedy = "name another folder, or use --force (force=True)"
    stored = _stored_identity(folder)
    if stored is None:
        if (folder / CSV).exists():
            raise bad_value("out", str(folder), f"{CSV} there is of an unknown sweep; {remedy}")
        return
    for key, value in json.loads(json.dumps(identity)).items():
        if stored.get(key) != value:
            if key == "scenes":
                raise bad_value("out", str(folder), f"it holds a sweep of scenes with other values; {remedy}")
            what = f"it holds a sweep with {key} = {_brief(stored.get(key))}, not {_brief(value)}"
            raise bad_value("out", str(folder), f"{what}; {remedy}")


def write_identity(folder: Path, identity: Mapping[str, object]) -> None:
    """Say in the folder what its rows are of.

    Raises:
        McaError: it cannot be written.
    """
    text = json.dumps(identity, indent=2) + "\n"
    with _writing(folder):
        write_atomically(folder / IDENTITY, lambda file: file.write(text.encode()))


def remove_sweep(folder: Path) -> None:
    """Remove the files of a sweep, and those of its runs.

    Raises:
        McaError: a file cannot be removed.
    """
    stored = _stored_identity(folder)
    count = stored.get("runs") if stored and stored.get("folders") is True else None
    with _writing(folder):
        runs = [path for path in folder.iterdir() if _is_run(path, count) and not path.is_symlink()]
        for run in runs:
            for name in ALL_FILES:
                (run / name).unlink(missing_ok=True)
            with suppress(OSError):  # it is not there, or other files are in it
                run.rmdir()
        for name in (REPORT, PARQUET, CSV, IDENTITY):
            (folder / name).unlink(missing_ok=True)


def _is_run(path: Path, count: object) -> bool:
    """Whether a folder has the name of one of `count` runs; False if that is not a valid number."""
    if type(count) is not int or not 0 < count <= MAX_COUNT:
        return False
    number = int(path.name) if re.fullmatch("[0-9]{1,10}", path.name) else count
    return number < count and path.name == run_name(number, count)


def _stored_identity(folder: Path) -> dict[str, Any] | None:
    try:
        found = json.loads((folder / IDENTITY).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Errors of the system while a sweep's files are written, in one sentence.

    Raises:
        McaError: there was one.
    """
    try:
        yield
    except OSError as error:
        raise McaError(f"the sweep could not be written to {folder}: {error.strerror or error}") from error


def _columns(rows: Iterable[Collection[str]]) -> list[str]:
    """All columns of rows, in the order in which they occur, the wall time last."""
    found = list(dict.fromkeys(name for row in rows for name in row))
    return sorted(found, key=lambda name: name == "wall")


def _alike(values: list[Any]) -> list[Any]:
    """A column of one type: whole numbers beside others become floats, other mixtures text."""
    kinds = {type(value) for value in values if value is not None}
    if kinds == {int, float}:
        return [None if value is None else float(value) for value in values]
    if len(kinds) > 1 or any(isinstance(value, int) and value.bit_length() > 63 for value in values):
        return [None if value is None else str(value) for value in values]
    return values


def _brief(value: object) -> str:
    """A value of an identity for a message: grids as `mu=0.1,0.3 v=1`."""
    if isinstance(value, dict):
        texts = {key: ",".join(map(str, item)) if isinstance(item, list) else str(item) for key, item in value.items()}
        value = " ".join(f"{key}={text}" for key, text in texts.items()) or "no parameters"
    return "none" if value is None else textwrap.shorten(str(value), LONGEST, placeholder=" …")
