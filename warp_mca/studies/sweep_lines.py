"""Owns the form of sweep.csv: a line a row, which gives its values back bit for bit, and a checksum at its end."""

from __future__ import annotations

import re
import zlib
from collections.abc import Sequence
from pathlib import Path

from warp_mca.studies.sweep_job import Row

FIELD = re.compile(r'("(?:[^"]|"")*"|[^,"]*)(,|$)')
NUMBER = re.compile(r"[+-]?\d+")
CHECKSUM, ENDING = b",checksum", re.compile(rb',"crc32:[0-9a-f]{8}"$')  # its column, the last one, and how lines end


def header_of(columns: Sequence[str]) -> str:
    """The first line."""
    return _names(columns) + CHECKSUM.decode() + "\n"


def line_of(columns: Sequence[str], row: Row) -> str:
    """The line of a row. Texts are quoted, numbers are not, nothing stands for None.

    The checksum is of the names of the columns, too.
    """
    text = ",".join(csv_text(row.get(name)) for name in columns)
    return text + _ending(_names(columns).encode(), text.encode()).decode() + "\n"


def read_lines(path: Path) -> tuple[list[Row], list[int]]:
    """The rows of a sweep.csv, without a line at its end that was not finished, and the numbers of damaged lines.

    Tables of earlier versions have no checksums.

    Raises:
        ValueError: it is not of the form that this module writes; if all of several lines seem damaged, the header is.
        KeyError: it lacks a column that every sweep has.
    """
    header, *lines = path.read_bytes().split(b"\n")[:-1] or [b""]
    if not header:
        return [], []
    summed = header.endswith(CHECKSUM)
    if not summed and any(ENDING.search(line) for line in lines):
        raise ValueError(header)
    header = header.removesuffix(CHECKSUM)
    names = [str(name) for name in _fields(header.decode())]
    end = -len(_ending(b"", b"")) if summed else None
    good = [not summed or line[end:] == _ending(header, line[:end]) for line in lines]
    if len(good) > 1 and not any(good):
        raise ValueError(header)
    whole = [line[:end] for line, is_good in zip(lines, good, strict=True) if is_good]
    rows = [dict(zip(names, _fields(line.decode()), strict=True)) for line in whole]
    if not all(isinstance(row["index"], int) and isinstance(row["status"], str) for row in rows):
        raise ValueError("index and status")
    return rows, [number for number, is_good in enumerate(good, 2) if not is_good]


def _names(columns: Sequence[str]) -> str:
    """The first line without the checksum's column."""
    return ",".join(name if re.fullmatch(r"[\w.]+", name) else csv_text(name) for name in columns)


def _ending(header: bytes, line: bytes) -> bytes:
    """What follows a line's values: the checksum as a text that no program takes for a number."""
    return b',"crc32:%08x"' % zlib.crc32(header + b"\n" + line)


def csv_text(value: object) -> str:
    """A value as sweep.csv has it."""
    if value is None:
        return ""
    return '"' + value.replace('"', '""') + '"' if isinstance(value, str) else repr(value)


def _fields(line: str) -> list[object]:
    """The values of a line, as they were before `csv_text`.

    Raises:
        ValueError: it is not a line that this module writes.
    """
    found, place = [], 0
    while True:
        match = FIELD.match(line, place)
        if not match:
            raise ValueError(line)
        found.append(_value(match[1]))
        place = match.end()
        if not match[2]:
            return found


def _value(text: str) -> object:
    if text.startswith('"'):
        return text[1:-1].replace('""', '"')
    if text in ("", "True", "False"):
        return {"": None, "True": True, "False": False}[text]
    try:
        return int(text) if NUMBER.fullmatch(text) else float(text)
    except ValueError:  # names of columns are not quoted
        return text
