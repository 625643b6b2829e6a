"""Owns the question whether a path can be written."""

from __future__ import annotations

import tempfile
from pathlib import Path

from warp_mca.errors import bad_value


def nearest(path: Path) -> Path:
    """The path itself, or the closest of its parents that exists."""
    return next(p for p in (path, *path.absolute().parents) if p.exists())


def check_folder(field: str, path: Path) -> None:
    """Refuses a path that cannot be made: what exists of it takes no file.

    Raises:
        RequestError: so it is, of what the user named `field`.
    """
    try:
        existing = nearest(path)
    except FileNotFoundError:  # the working directory is gone, which is no fault of the name
        raise
    except OSError as error:  # as of a name that is too long
        raise bad_value(field, str(path), f"{error.strerror or error}; name another") from error
    if not existing.is_dir():
        raise bad_value(field, str(path), f"{existing} is not a folder; name another")
    try:  # root may write to folders that take no file all the same
        tempfile.TemporaryDirectory(prefix=".warp_mca-", dir=existing).cleanup()
    except OSError as error:
        what = f"{existing} cannot be written to ({error.strerror or error}); name another"
        raise bad_value(field, str(path), what) from error
