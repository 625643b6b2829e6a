"""Owns what is checked of recorders before a run begins: their attributes, and that no two write the same file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.recorders.recorder import NEEDS, Cadence, Recorder, file_path
from warp_mca.results.storage import ALL_FILES


def files_of(recorders: Sequence[Recorder]) -> list[Path]:
    """The files that recorders write."""
    return [Path(file) for recorder in recorders for file in getattr(recorder, "files", ())]


def check_files(recorders: Sequence[Recorder], out: str | os.PathLike[str] | None = None) -> None:
    """Check the attributes of recorders, and that no two outputs write the same file.

    Args:
        recorders: of the run.
        out: folder of the results, or None.

    Raises:
        RequestError: an attribute has another type than `Recorder` says; or two files, of recorders or in `out`, are
            the same, or one is a folder above the other.
    """
    for k, recorder in enumerate(recorders):
        _check_attributes(f"recorders[{k}]", recorder)
    known = [Path(out, name).resolve() for name in ALL_FILES] if out is not None else []
    for file in files_of(recorders):
        path = file.resolve()
        for other in known:
            if path == other:
                raise bad_value("recorders", str(file), "two outputs write this file; give each a file of its own")
            if path in other.parents or other in path.parents:
                raise bad_value("recorders", str(file), f"it cannot be there beside {other}; name another file")
        known.append(path)


def _check_attributes(field: str, recorder: Recorder) -> None:
    """Raise RequestError for attributes of a recorder that have other types than `Recorder` says."""
    validate.texts(field, name=recorder.name)
    validate.kinds(field, Cadence, "give a Cadence, as Cadence(frames=100)", cadence=recorder.cadence)
    remedy = f"give a frozenset of what frames must hold, out of {', '.join(NEEDS)}"
    validate.kinds(field, (set, frozenset, tuple, list), remedy, needs=recorder.needs)
    for need in recorder.needs:
        if not (isinstance(need, str) and need in NEEDS):
            raise bad_value(f"{field}.needs", validate.brief(need), remedy)
    files = getattr(recorder, "files", ())
    validate.kinds(field, (tuple, list), "give a tuple of the paths that it writes", files=files)
    for k, file in enumerate(files):
        file_path(f"{field}.files[{k}]", file)
