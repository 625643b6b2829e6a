"""Owns the use of gmsh: in a process of its own for files, in this one for recipes, which gmsh meshes safely.

A damaged file can crash gmsh, or keep it busy for ever and deaf to signals: two flipped bytes of a STEP file suffice.
"""

from __future__ import annotations

import builtins
import ctypes
import os
import pickle
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import Any

from warp_mca.base import validate
from warp_mca.base.errors import RequestError, bad_value

# Environment variable: most processor time for reading a file, and for meshing it [s]. Time by the clock would refuse
# on a busy machine what works on a free one.
LIMIT = "WARP_MCA_MESH_TIME"
_IDLE = 20.0  # times that limit by the clock, for a process that waits for ever
DEFAULT_LIMIT = 600.0  # for a file whose size the caller does not tell [s]
DYING = 5.0  # time that a process which answers no more takes to end, at most [s]
TOO_LONG = "it took more than"  # so begins what is said of a process that was ended for its time
_LIBRARIES = "libglu1-mesa libgl1 libxft2 libxcursor1 libxinerama1 libgomp1"
_OPTIONS = {"General.Terminal": 0.0, "General.NumThreads": 1.0, "Mesh.ElementOrder": 1.0}
_START = {"readConfigFiles": False, "interruptible": False}  # signal handlers need the main thread
_SERVER = Path(__file__).with_name("gmsh_server.py")
_one_at_a_time = threading.Lock()  # gmsh keeps one global state


@contextmanager
def gmsh_session(allowed: float = DEFAULT_LIMIT, /, **more: float) -> Iterator[Any]:
    """gmsh with an empty model in a process of its own, whose functions are called as those of the module `gmsh`.

    They raise Exception, as gmsh does, also where gmsh crashes or takes too long. The process ends with the session.

    Args:
        allowed: processor time for all calls [s], unless the environment variable `LIMIT` gives another one or `allow`
            more.
        more: gmsh's options by name, with "__" for the dot, as Mesh__Algorithm3D.

    Raises:
        RequestError: gmsh or a library that it needs is missing, or the time limit is no number above 0.
    """
    process = _Process(_limit(allowed))
    try:
        gmsh = _Remote(process, "")
        with _explained():
            gmsh.initialize(**_START)
        for name, value in _options(more).items():
            gmsh.option.setNumber(name, value)
        gmsh.model.add("warp_mca")
        yield gmsh
    finally:
        process.end()


def allow(gmsh: Any, allowed: float) -> None:
    """Allow a session's process so much processor time from now on [s], unless the environment gives another limit."""
    gmsh._process.allow(_limit(allowed))


class _Process:
    """The process, and the time until it is ended."""

    def __init__(self, limit: float) -> None:
        """Start it, with that limit of time [s]."""
        command = [sys.executable, "-P", str(_SERVER)]
        # a session of its own: an interrupt from the keyboard is for this process alone
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
        )
        self.broken = ""
        self._send(sys.path)
        self.allow(limit)

    def call(self, name: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        """What a function of gmsh returns.

        Raises:
            Exception: gmsh raised it, crashed, or took too long.
        """
        assert self.process.stdout is not None
        self._send((name, args, kwargs))
        if not self.broken:
            ready, *_ = select.select([self.process.stdout], [], [], max(self.end_time - time.monotonic(), 0.0))
            try:
                if not ready:
                    raise TimeoutError
                good, answer = pickle.load(self.process.stdout)
            except TimeoutError:
                self.broken = self._too_long("")
            except (EOFError, pickle.UnpicklingError):
                end = self._how_it_ended()
                used_up = end == signal.SIGPROF.name
                crash = f"it crashed, as damaged files may make it: {end}"
                self.broken = self._too_long(" of processor time") if used_up else crash
            else:
                if good:
                    return answer
                kind = getattr(builtins, answer[0], RuntimeError)
                raise kind(answer[1])
        self.end()
        raise Exception(self.broken)  # as gmsh's own errors are

    def allow(self, limit: float) -> None:
        """Let it take so much processor time from now on [s]: the process counts it itself."""
        self.limit, self.end_time = limit, time.monotonic() + min(_IDLE * limit, threading.TIMEOUT_MAX)
        self._send(limit)

    def end(self) -> None:
        """Kill it, whatever it is doing."""
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            with suppress(OSError):  # what could not be sent cannot be flushed
                pipe.close()

    def _too_long(self, kind: str) -> str:
        longer = f"the environment variable {LIMIT}={10.0 * self.limit:.2g} allows ten times as many"
        seconds = self.limit if kind else _IDLE * self.limit
        return f"{TOO_LONG} {seconds:.2g} s{kind}, as damaged files may make it; {longer}"

    def _send(self, what: object) -> None:
        assert self.process.stdin is not None
        try:
            pickle.dump(what, self.process.stdin)
            self.process.stdin.flush()
        except (OSError, ValueError):  # it is gone, or was ended
            self.broken = self.broken or f"it crashed: {self._how_it_ended()}"

    def _how_it_ended(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(DYING)
        self.process.kill()
        code = self.process.wait()
        return signal.Signals(-code).name if code < 0 else f"exit status {code}"


class _Remote:
    """A module or a function of gmsh in the other process."""

    def __init__(self, process: _Process, name: str) -> None:
        self._process, self._name = process, name

    def __getattr__(self, name: str) -> _Remote:
        if name.startswith("__"):
            raise AttributeError(name)
        return _Remote(self._process, f"{self._name}.{name}" if self._name else name)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._process.call(self._name, args, kwargs)


@contextmanager
def gmsh_here(**more: float) -> Iterator[ModuleType]:
    """gmsh without output and with an empty model in this process; a session that the caller has open is not changed.

    Args:
        more: as in `gmsh_session`.

    Raises:
        RequestError: gmsh or a library that it needs is missing.
    """
    with _explained():
        import gmsh
    with _one_at_a_time:
        mine = not gmsh.isInitialized()
        if mine:
            with _signals_kept():
                gmsh.initialize(**_START)
        before = None if mine else gmsh.model.getCurrent()
        options = _options(more)
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


@contextmanager
def _explained() -> Iterator[None]:
    """Say what an import of gmsh lacks.

    Raises:
        RequestError: gmsh or a library that it needs is missing.
    """
    try:
        yield
    except ImportError as error:
        raise RequestError(f"gmsh cannot be imported ({error}): install it with pip install gmsh") from error
    except OSError as error:
        raise RequestError(
            f"gmsh lacks a system library ({error}): install them with apt-get install {_LIBRARIES}"
        ) from error


def _options(more: dict[str, float]) -> dict[str, float]:
    """gmsh's options by their own names."""
    return _OPTIONS | {name.replace("__", "."): value for name, value in more.items()}


def _limit(allowed: float) -> float:
    """The longest time [s]: that of the environment, or the one given.

    Raises:
        RequestError: the environment names none.
    """
    text = os.environ.get(LIMIT, str(allowed))
    with suppress(ValueError):
        if validate.is_number(limit := float(text)) and limit > 0.0:
            return min(limit, threading.TIMEOUT_MAX)
    raise bad_value(LIMIT, text, "give the longest time [s] for reading a file, and for meshing it")


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
