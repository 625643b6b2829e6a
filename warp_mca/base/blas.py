"""Owns the threads of the BLAS behind SciPy's LAPACK, where it is OpenBLAS."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any

NAMES = ("scipy_openblas_{}_num_threads", "openblas_{}_num_threads")  # of SciPy's wheels, and of others
Threads = tuple[Callable[[], int], Callable[[int], Any]]


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let LAPACK compute with one thread until the block ends: the same bits on any number of cores.

    Band factors are hundreds of small calls, in each of which threads wait for each other: 0.02 s of a matrix of 3,804
    rows and 372 diagonals on one thread, 1 to 4 s on two whose cores others loaded.
    """
    found = lapack_threads()
    if not found:
        yield
        return
    number, use = found
    before = number()
    use(1)
    try:
        yield
    finally:
        use(before)


@cache
def lapack_threads() -> Threads | None:
    """How many threads LAPACK has, and how to set their number; None where SciPy has another BLAS."""
    try:
        library = ctypes.CDLL(import_module("scipy.linalg._flapack").__file__)  # also finds what it is linked with
    except (ImportError, OSError, TypeError):
        return None
    for name in NAMES:
        if hasattr(library, name.format("get")) and hasattr(library, name.format("set")):
            return getattr(library, name.format("get")), getattr(library, name.format("set"))
    return None
