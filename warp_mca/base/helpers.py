"""Owns the helpers of this process: processes that do a part of its work, side by side, kept for the next batch."""

from __future__ import annotations

import atexit
import io
import os
import pickle
import select
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T")
_PROGRAM = Path(__file__).with_name("helper.py")
_OWN = ("warp_mca.", "numpy.", "builtins.", "pathlib.")  # where classes are that a helper knows


class _LostError(Exception):
    """A helper ended."""


class _Helper:
    """One process, which has one job at a time; the first is to begin."""

    def __init__(self, modules: Sequence[str]) -> None:
        command = [sys.executable, "-P", str(_PROGRAM)]
        env = {**os.environ, "CUDA_VISIBLE_DEVICES": ""}  # no context of its own on a GPU, which takes memory and time
        # a session of its own: an interrupt from the keyboard is for this process alone
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True, env=env
        )
        assert self.process.stdin is not None and self.process.stdout is not None
        self._to, self._from = self.process.stdin, self.process.stdout
        self.begun = False
        self.send(pickle.dumps(sys.path) + pickle.dumps(tuple(modules)))

    def fileno(self) -> int:
        """Of the pipe that can be read when there is an answer, or when it has ended."""
        return self._from.fileno()

    def send(self, job: bytes) -> None:
        """Give it a job."""
        try:
            self._to.write(job)
            self._to.flush()
        except OSError as error:
            raise _LostError from error

    def answer(self) -> Any:
        """Of the job."""
        try:
            return pickle.load(self._from)
        except (EOFError, OSError, pickle.UnpicklingError) as error:
            raise _LostError from error

    def end(self) -> None:
        """Kill it, whatever it is doing."""
        self.process.kill()
        self.process.wait()
        for pipe in (self._to, self._from):
            with suppress(OSError):  # what could not be sent cannot be flushed
                pipe.close()


class Helpers:
    """Processes of one kind.

    They know the package and NumPy. Scenes of other classes, and those of a process that registered kinds of its own,
    are not for them.
    """

    def __init__(self, *modules: str) -> None:
        """None yet; each imports these modules first."""
        self._modules = modules
        self._all: list[_Helper] = []
        self._where: object = None
        self._owner = os.getpid()
        atexit.register(self.end)

    @property
    def count(self) -> int:
        """How many wait for a job."""
        if self._where != _surroundings():
            return 0
        answered = select.select(self._all, [], [], 0.0)[0]
        return sum(helper.process.poll() is None and (helper.begun or helper in answered) for helper in self._all)

    def carry_out(
        self,
        function: Callable[..., T],
        jobs: int,
        data: Callable[[int], bytes],
        here: Callable[[int], T],
        count: int,
        told: Callable[[int, T], None] = lambda k, answer: None,
    ) -> list[T]:
        """What `function` returns for the pickled arguments of each job, `here(k)` being the same for job k.

        This process computes some while helpers begin, and those of helpers that were killed, or that raise.

        Args:
            function: one of the package.
            jobs: how many there are.
            data: pickled tuple of the arguments of a job, of classes that `travel`.
            here: what this process calls in place of `function`.
            count: of helpers.
            told: of each job that is done, and what came of it.

        Raises:
            Exception: what `here` raises for the first of the jobs that fail.
        """

        def message(k: int) -> bytes:
            return pickle.dumps((function.__module__, function.__qualname__, data(k)))

        try:
            answers = self._answers(jobs, message, here, count, told)
        except BaseException:
            self.end()
            raise
        return [answers[k] if k in answers else here(k) for k in range(jobs)]

    def end(self) -> None:
        """End all; a copy of the process that started them, as `fork` makes it, leaves them alone."""
        for helper in self._all if self._owner == os.getpid() else ():
            helper.end()
        self._all, self._owner = [], os.getpid()

    def _answers(
        self,
        jobs: int,
        message: Callable[[int], bytes],
        here: Callable[[int], T],
        count: int,
        told: Callable[[int, T], None],
    ) -> dict[int, T]:
        self.begin(count)
        left, answers = deque(range(jobs)), {}
        busy: dict[_Helper, int | None] = {helper: None for helper in self._all if not helper.begun}
        for helper in [helper for helper in self._all if helper.begun]:
            self._next(helper, message, left, busy)
        while left or any(k is not None for k in busy.values()):
            begun = any(helper.begun for helper in busy)
            for helper in select.select(list(busy), [], [], None if begun else 0.0)[0]:
                k = busy.pop(helper)
                try:
                    found = helper.answer()
                    helper.begun = True
                    if k is not None and found[0]:
                        answers[k] = found[1]
                        told(k, found[1])
                    self._next(helper, message, left, busy)
                except _LostError:
                    self._lose(helper)
                    left.extend(() if k is None else (k,))
            if left and not any(helper.begun for helper in busy):
                k = left.popleft()
                with suppress(Exception):  # raised at the end, if it is the first
                    answers[k] = here(k)
                    told(k, answers[k])
        return answers

    def begin(self, count: int) -> None:
        """Start so many, unless they are there; nobody waits for them."""
        if self._where != _surroundings():
            self.end()
        self._where = _surroundings()
        for helper in [helper for helper in self._all if helper.process.poll() is not None]:
            self._lose(helper)
        with suppress(OSError, _LostError):
            while len(self._all) < count:
                self._all.append(_Helper(self._modules))

    def _next(
        self, helper: _Helper, message: Callable[[int], bytes], left: deque[int], busy: dict[_Helper, int | None]
    ) -> None:
        if not left:
            return
        k = left.popleft()
        try:
            helper.send(message(k))
        except _LostError:
            self._lose(helper)
            left.append(k)
        else:
            busy[helper] = k

    def _lose(self, helper: _Helper) -> None:
        helper.end()
        self._all.remove(helper)


def travel(data: bytes) -> bool:
    """Whether pickled objects are of classes that helpers know."""
    try:
        _Reader(io.BytesIO(data)).load()
    except pickle.UnpicklingError:
        return False
    return True


class _Reader(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if not f"{module}.".startswith(_OWN):
            raise pickle.UnpicklingError(module)
        return super().find_class(module, name)


def _surroundings() -> object:
    """What a helper has of this process from its start on; None where the working directory is gone."""
    try:
        return os.getpid(), str(Path.cwd()), tuple(sys.path), dict(os.environ)
    except OSError:
        return None
