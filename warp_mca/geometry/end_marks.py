"""Owns the marks at the end of mesh files of other programs, which one that was cut off lacks."""

from __future__ import annotations

from pathlib import Path

_LAST = {".bdf": "ENDDATA", ".nas": "ENDDATA", ".fem": "ENDDATA", ".k": "*END", ".key": "*END", ".dyn": "*END"}
END_REQUIRED = (".unv", ".bdf", ".nas", ".fem")  # the others may do without


def missing_end(path: Path) -> str | None:
    """What a file lacks at its end, in words; None where it lacks nothing, or its format has no such mark."""
    suffix = path.suffix.lower()
    if suffix == ".unv":
        with path.open(errors="replace") as lines:
            marks = sum(line.strip() == "-1" for line in lines)  # before and after each of its sections
        return "the -1 after its last section" if marks % 2 else None
    last = _LAST.get(suffix)
    if last is None:
        return None
    with path.open(errors="replace") as lines:
        return None if any(line.upper().startswith(last) for line in lines) else last
