"""Owns the process's standard streams, and the messages about errors of the system."""

from __future__ import annotations

import errno
import io
import os
import sys
from contextlib import suppress


def what_failed(error: OSError) -> str:
    """The system's error in one sentence."""
    what = error.strerror or str(error)
    if error.filename is None and isinstance(error, FileNotFoundError):
        return "the working directory is gone: change to one that exists"
    if error.filename:
        return f"{error.filename}: {what}; name another"
    return f"standard output: {what}" if error.errno in (errno.ENOSPC, errno.EIO) else what


def open_streams() -> None:
    """Reopen closed standard streams, so that files do not take their descriptors; replace unprintable characters."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free descriptor
            setattr(sys, name, open(number, "r" if number == 0 else "w", closefd=False))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def drop_output() -> None:
    """Redirect standard output to the null device, so that Python does not flush it again at exit."""
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
