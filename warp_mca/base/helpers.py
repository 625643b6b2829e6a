"""Owns the helpers of this process: processes that do a part of its work, side by side, kept for the next batch."""

from __future__ import annotations

import atexit
import fcntl
import io
import os
import pickle
import select
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

T = TypeVar("T")
Busy = dict["Helper", deque["int | None"]]  # numbers of the jobs of each helper, None for its begin
_PROGRAM = Path(__file__).with_name("helper.py")
ROOM = 1 << 20  # of a pipe [byte]
_OWN = ("warp_mca.", "numpy.", "builtins.", "pathlib.")  # where classes are that a helper knows


class LostError(Exception):
    """A helper ended, or could not do what it was asked."""


class Helper:
    """One process, which does its jobs in turn; the first is to begin."""

    def __init__(self, modules: Sequence[str]) -> None:
        command = [sys.executable, "-P", str(_PROGRAM)]
        env = {**os.environ, "CUDA_VISIBLE_DEVICES": ""}  # no context of its own on a GPU, which takes memory and time
        # a session of its own: an interrupt from the keyboard is for this process alone
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True, env=env
        )
        assert self.process.stdin is not None and self.process.stdout is not None
        self._to, self._from = self.process.stdin, self.process.stdout
        for pipe in (self._to, self._from):
            _widen(pipe.fileno())
        self.begun = False
        self._asked, self._next, self._answers = 0, 0, dict[int, Any]()
        self.send(pickle.dumps(sys.path) + pickle.dumps(tuple(modules)))

    def fileno(self) -> int:
        """Of the pipe that can be read when there is an answer, or when it has ended."""
        return self._from.fileno()

    def send(self, job: bytes) -> None:
        """Give it a job."""
        try:
            self._to.write(job)
            self._to.flush()
        except (OSError, ValueError) as error:  # it is gone, or was ended here
            raise LostError from error

    def answer(self) -> Any:
        """Of the job."""
        try:
            return pickle.load(self._from)
        except (EOFError, OSError, ValueError, pickle.UnpicklingError) as error:
            raise LostError from error

    @property
    def owes(self) -> bool:
        """Whether answers to `ask` were not taken."""
        return self._next < self._asked

    def ask(self, function: Callable[..., Any], *args: Any) -> int:
        """Let it call a function of the package while this process goes on; the number under which it answers.

        Raises:
            LostError: it has ended.
        """
        self.send(message(function, pickle.dumps(args, protocol=pickle.HIGHEST_PROTOCOL)))
        self._asked += 1
        return self._asked - 1

    def told(self, number: int) -> Any:
        """Wait for what a function returned.

        Raises:
            LostError: it has ended, or the function raised an error.
        """
        while self._next <= number:
            self._answers[self._next] = self.answer()
            self._next += 1
        done, found = self._answers.pop(number)
        if not done:
            raise LostError
        return found

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

    Attributes:
        by: which of them did each job of the latest call of `carry_out`; those of this process are not there.
    """

    def __init__(self, *modules: str) -> None:
        """None yet; each imports these modules first."""
        self._modules = modules
        self._all: list[Helper] = []
        self.by: dict[int, Helper] = {}
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

        self.by = {}
        try:
            answers = self._answers(jobs, lambda k: message(function, data(k)), here, count, told)
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
        busy: Busy = {helper: deque[int | None]([None]) for helper in self._all if not helper.begun}
        for helper in [helper for helper in self._all if helper.begun]:
            self._next(helper, message, left, busy)
        while left or any(k is not None for asked in busy.values() for k in asked):
            begun = any(helper.begun for helper in busy)
            for helper in select.select(list(busy), [], [], None if begun else 0.0)[0]:
                k = busy[helper].popleft()
                try:
                    found = helper.answer()
                    helper.begun = True
                    if k is not None and found[0]:
                        answers[k], self.by[k] = found[1], helper
                        told(k, found[1])
                except LostError:
                    self._lose(helper, [k, *busy.pop(helper)], left)
                else:
                    self._next(helper, message, left, busy)
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
        for helper in [helper for helper in self._all if helper.process.poll() is not None or helper.owes]:
            self._lose(helper)  # also one that was left in the middle of what it was asked
        with suppress(OSError, LostError):
            while len(self._all) < count:
                self._all.append(Helper(self._modules))

    def _next(self, helper: Helper, message: Callable[[int], bytes], left: deque[int], busy: Busy) -> None:
        """Ask for jobs: one, or two while all helpers get more, so that none waits for this process to read answers."""
        asked = busy.pop(helper, deque())
        try:
            while left and len(asked) < (2 if len(left) > len(self._all) else 1):
                asked.append(left.popleft())
                helper.send(message(cast("int", asked[-1])))
        except LostError:
            self._lose(helper, asked, left)
        else:
            if asked:
                busy[helper] = asked

    def _lose(self, helper: Helper, asked: Iterable[int | None] = (), left: deque[int] | None = None) -> None:
        """End a helper; others do what it was asked."""
        helper.end()
        self._all.remove(helper)
        if left is not None:
            left.extend(k for k in asked if k is not None)


def message(function: Callable[..., Any], data: bytes) -> bytes:
    """A job as a helper takes it: a function of the package, and a pickled tuple of its arguments."""
    return pickle.dumps((function.__module__, function.__qualname__, data), protocol=pickle.HIGHEST_PROTOCOL)


def _widen(pipe: int) -> None:
    """Let a pipe hold more at once, where the system can: a reader that is busy otherwise stops the writer."""
    with suppress(OSError, AttributeError):
        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, ROOM)


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
