"""Owns the checks of paths that users give: whether the value is a path, and whether it can be written."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO

from warp_mca.base.errors import bad_value
from warp_mca.base.validate import brief


def given_path(field: str, value: object, remedy: str) -> Path:
    """The user's value of `field` as a path; an empty name is refused, because it would mean the working directory.

    Raises:
        RequestError: it is no path.
    """
    text = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not (isinstance(text, str) and text and "\0" not in text):
        raise bad_value(field, brief(value), remedy)
    return Path(text)


def nearest(path: Path) -> Path:
    """The path itself, or the closest of its parents that exists."""
    return next(p for p in (path, *path.absolute().parents) if p.exists())


def check_folder(field: str, path: Path) -> None:
    """Check that a folder exists and can be written to, or can be created.

    Args:
        field: name of the option, for the message.
        path: the folder.

    Raises:
        RequestError: it cannot be created or written.
    """
    try:
        existing = nearest(path)
    except FileNotFoundError:  # the working directory was deleted; the name is not at fault
        raise
    except OSError as error:  # for example, the name is too long
        raise bad_value(field, str(path), f"{error.strerror or error}; name another") from error
    if not existing.is_dir():
        raise bad_value(field, str(path), f"{existing} is not a folder; name another")
    try:  # for root, access() allows folders that refuse files nevertheless
        tempfile.TemporaryDirectory(prefix=".warp_mca-", dir=existing).cleanup()
    except OSError as error:
        what = f"{existing} cannot be written to ({error.strerror or error}); name another"
        raise bad_value(field, str(path), what) from error


def write_atomically(target: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file by `write` completely or not at all; an older file is replaced.

    Raises:
        OSError: the file cannot be written.
    """
    descriptor, name = tempfile.mkstemp(prefix=f".{target.name}-", dir=target.parent)
    temporary = Path(name)
    try:
        with os.fdopen(descriptor, "wb") as file:
            write(file)
        temporary.chmod(0o666 & ~_umask())  # mkstemp lets only the owner read
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
