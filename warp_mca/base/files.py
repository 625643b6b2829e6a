"""Owns files: checks of paths that users give, files that are written whole or not at all, what a kill left of them."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from warp_mca.base.errors import bad_value
from warp_mca.base.validate import brief

UNFINISHED = ".warp_mca-"  # prefix of hidden files and folders that are written before they get their names
LEFTOVERS = (f"{UNFINISHED}*", ".checkpoint.npz-????????", ".sweep.*-????????")  # the last two of earlier versions


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
        tempfile.TemporaryDirectory(prefix=UNFINISHED, dir=existing).cleanup()
    except OSError as error:
        what = f"{existing} cannot be written to ({error.strerror or error}); name another"
        raise bad_value(field, str(path), what) from error


def write_atomically(target: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file by `write` completely or not at all; an older file is replaced.

    Raises:
        OSError: the file cannot be written.
    """
    with _temporary(lambda: tempfile.mkstemp(prefix=f"{UNFINISHED}{target.name}-", dir=target.parent)) as temporary:
        try:
            with temporary.open("wb") as file:
                write(file)
            temporary.chmod(0o666 & ~_umask())  # mkstemp lets only the owner read
            temporary.replace(target)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


@contextmanager
def temporary_folder(beside: Path) -> Iterator[Path]:
    """A hidden folder in the folder `beside`, which is removed at the end."""
    with _temporary(lambda: (None, tempfile.mkdtemp(prefix=UNFINISHED, dir=beside))) as folder:
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _temporary(make: Callable[[], tuple[int | None, str]]) -> Iterator[Path]:
    """The path of a file or folder that `make` makes, locked meanwhile so that `clear_leftovers` spares it."""
    while True:
        made, name = make()
        path = Path(name)
        descriptor = os.open(path, os.O_RDONLY) if made is None else made
        try:
            with suppress(OSError):  # a file system without locks
                fcntl.flock(descriptor, fcntl.LOCK_EX)
            if path.exists():  # it was not taken for a leftover before it was locked
                yield path
                return
        finally:
            os.close(descriptor)


def clear_leftovers(folder: Path) -> None:
    """Remove files that killed processes left in a folder while they wrote, which nobody has locked."""
    for path in [path for pattern in LEFTOVERS for path in folder.glob(pattern)]:
        with suppress(OSError):  # of another user, locked, or gone by now
            descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if path.is_dir():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    path.unlink()
            finally:
                os.close(descriptor)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
