"""Owns the use of gmsh: one session at a time, silent, without a trace in the process that calls it."""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from warp_mca.base.errors import RequestError

_LIBRARIES = "libglu1-mesa libgl1 libxft2 libxcursor1 libxinerama1 libgomp1"
_one_at_a_time = threading.Lock()  # gmsh keeps one global state


@contextmanager
def _signals_kept() -> Iterator[None]:
    """Restore signal handlers: gmsh resets SIGTERM and others when it starts, and Python is not told.

    In C, because Python takes signals in the main thread only, and knows no handler of a library.
    """
    sigaction = ctypes.CDLL(None).sigaction
    kept = {number: ctypes.create_string_buffer(1024) for number in signal.valid_signals()}  # more than the struct
    for number, action in kept.items():
        sigaction(int(number), None, action)
    try:
        yield
    finally:
        for number, action in kept.items():
            sigaction(int(number), action, None)


@contextmanager
def gmsh_session(**more: float) -> Iterator[ModuleType]:
    """gmsh without output and with an empty model; a session that the caller has open is not changed.

    Args:
        more: gmsh's options by name, with "__" for the dot, as Mesh__Algorithm3D.

    Raises:
        RequestError: gmsh or a library that it needs is missing.
    """
    try:
        import gmsh
    except ImportError as error:
        raise RequestError(f"gmsh cannot be imported ({error}): install it with pip install gmsh") from error
    except OSError as error:
        raise RequestError(
            f"gmsh lacks a system library ({error}): install them with apt-get install {_LIBRARIES}"
        ) from error
    with _one_at_a_time:
        mine = not gmsh.isInitialized()
        if mine:
            with _signals_kept():
                gmsh.initialize(readConfigFiles=False, interruptible=False)  # signal handlers need the main thread
        before = None if mine else gmsh.model.getCurrent()
        options = {"General.Terminal": 0.0, "General.NumThreads": 1.0, "Mesh.ElementOrder": 1.0}
        options |= {name.replace("__", "."): value for name, value in more.items()}
        saved = {name: gmsh.option.getNumber(name) for name in options}
        try:
            for name, value in options.items():
                gmsh.option.setNumber(name, value)
            gmsh.model.add("warp_mca")
            yield gmsh
        finally:
            if mine:
                gmsh.finalize()
            else:
                gmsh.model.remove()
                gmsh.model.setCurrent(before)
                for name, value in saved.items():
                    gmsh.option.setNumber(name, value)
