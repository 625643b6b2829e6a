"""Owns the process's standard streams, and how what the system refuses is told."""

from __future__ import annotations

import errno
import io
import os
import sys
from contextlib import suppress


def what_failed(error: OSError) -> str:
    """One sentence of what the system refused."""
    what = error.strerror or str(error)
    if error.filename is None and isinstance(error, FileNotFoundError):
        return "the working directory is gone: change to one that exists"
    if error.filename:
        return f"{error.filename}: {what}; name another"
    return f"standard output: {what}" if error.errno in (errno.ENOSPC, errno.EIO) else what


def open_streams() -> None:
    """Files would take the numbers of standard streams that are closed; a name may hold what they cannot print."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
            setattr(sys, name, open(number, "r" if number == 0 else "w", closefd=False))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def drop_output() -> None:
    """Leave nothing that Python would try to print once more at its end."""
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
