"""Owns checkpoints: the file that a run stores its state in, and from which the same request goes on."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import McaError, bad_value
from warp_mca.base.log import warn
from warp_mca.base.validate import DAMAGE
from warp_mca.phases.every import Every

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact
    from warp_mca.phases.settings import Settings
    from warp_mca.step.steps import Steps

FILE = "checkpoint.npz"
ENDED = "checkpoint-{}.npz"  # state at the end of an impact, in a run of several
HEADER, MORE = "run/header", "run/more/"  # in that file, beside the arrays of the state
SHORTEST = 4.0  # parts into which the time between two checkpoints is cut at least, to hit it


class Checkpoint:
    """The file in a run's folder. It is replaced by rename, so that it is whole whenever a run is stopped.

    Attributes:
        path: of the file.
        every: how often it is written.
        rows: the state can be stored at each so many rows of the history.
    """

    def __init__(self, folder: Path, every: Every, force: bool = False) -> None:
        """Of the folder of a run; with `force` the run begins anew."""
        self.path, self.every, self.request, self.rows = folder / FILE, every, {}, 1
        self._steps, self._time, self._rate, self._begun = 0, time.perf_counter(), 0.0, 0
        self._failed = False  # the last time: a warning says so once
        if force:
            self.remove()

    def is_for(self, impact: Impact, span: float, settings: Settings, method: str) -> None:
        """Say what the run is, `span` [s] of impact: another one does not go on from its file."""
        from warp_mca.system.state import digest  # which imports Warp, that the command line need not

        ready, solver = impact.ready[0], impact.solver
        self.request = {
            "method": method,
            "model": digest(solver.model),
            "paths": digest(ready.probes),
            "sensors": digest(ready.sensors),
            "impact": repr(ready.scene.impact),
            "t_end": repr(ready.scene.t_end),
            "phases": repr(ready.scene.phases),
            "controllers": repr(impact.controls.plan),
            "span": repr(span),
            "dt": repr(solver.dt),
            "precision": settings.precision,
            "device": settings.device.partition(":")[0],
        }

    def next_stop(self, impact: Impact) -> int:
        """Step at which to look next whether the state is to be stored, at the end of an output interval."""
        steps, now = impact.steps, impact.state.steps
        if self.every.unit == "wall":
            wait = max(self.every.count - (time.perf_counter() - self._time), self.every.count / SHORTEST)
            ahead = wait / SHORTEST * self._rate
        else:
            ahead = self._wanted(impact.steps) - (now - self._steps)
        row = now // steps.per_interval + max(1, math.ceil(ahead / steps.per_interval))
        return -(-row // self.rows) * self.rows * steps.per_interval

    def is_due(self, impact: Impact) -> bool:
        """Whether enough has been done since the state was last stored."""
        done, past = impact.state.steps - self._steps, time.perf_counter() - self._time
        self._rate = (impact.state.steps - self._begun) / past if past > 0.0 else 0.0
        return past >= self.every.count if self.every.unit == "wall" else done >= self._wanted(impact.steps)

    def begin(self, impact: Impact) -> None:
        """Count from the present step on."""
        self._steps = self._begun = impact.state.steps
        self._time = time.perf_counter()

    def store(self, impact: Impact, place: Mapping[str, Any], more: Mapping[str, NDArray] | None = None) -> None:
        """Write the state, a `place` in the run that JSON can hold, and `more` arrays.

        Where the file cannot be written, it stays as it was, a warning says so, and the run goes on.
        """
        head = {"request": self.request, "command": self.every.command, "place": place}
        arrays: dict[str, NDArray] = {MORE + name: array for name, array in (more or {}).items()}
        arrays[HEADER] = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
        try:
            impact.save(self.path, arrays)
        except OSError as error:
            if not self._failed:
                warn([f"the state could not be written to {self.path} ({error.strerror or error}): the run goes on"])
            self._failed = True
        else:
            self._failed = False
        self.begin(impact)

    def store_end(self, impact: Impact, number: int) -> None:
        """Write the state of an impact that has ended, but for its last record, to a file of its own."""
        place = {"impact": number}
        self.store(impact, place)
        if not self._failed:
            self.path.replace(self._ended(number))

    def stored(self, impact: int | None = None) -> tuple[dict[str, Any], dict[str, NDArray], Path] | None:
        """Place and arrays that an earlier run of the same request stored, and the file that has them, or None.

        `impact`: number of one of several; what is stored of another one is left alone.

        Raises:
            RequestError: the file is damaged or of another request.
        """
        ended = None if impact is None else self._ended(impact)
        path = ended if ended and ended.exists() else self.path
        if not path.exists():
            return None
        head, more = _read(path)
        if head["place"].get("impact", impact) != impact:
            return None
        if head["request"] != self.request:
            other = next(key for key in self.request if head["request"].get(key) != self.request[key])
            remedy = f"{FILE} there is of another request ({other}); name another folder, or use --force (force=True)"
            raise bad_value("out", str(self.path.parent), remedy)
        return head["place"], more, path

    def remove(self) -> None:
        """Remove the files of a run that is over."""
        for path in (self.path, *self.path.parent.glob(ENDED.format("*"))):
            path.unlink(missing_ok=True)

    def _ended(self, number: int) -> Path:
        return self.path.with_name(ENDED.format(number))

    def _wanted(self, steps: Steps) -> int:
        """Steps from one checkpoint to the next."""
        return max(1, round(self.every.count if self.every.unit == "steps" else self.every.count / steps.dt))


def stored_command(folder: Path) -> dict[str, Any]:
    """What `Every.command` was of the run that stored its state in a folder: a mapping, of which nothing is checked.

    Raises:
        RequestError: there is no such state, it is damaged, or a Python program stored it.
    """
    path = folder / FILE
    if not path.is_file():
        raise bad_value("folder", str(folder), f"there is no {FILE}; name the folder of a run that was stopped")
    command = _read(path)[0]["command"]
    if command is None:
        raise bad_value("folder", str(folder), "mca.run stored this state, not a command; call it again with this out")
    if not isinstance(command, dict):
        raise bad_value("folder", str(folder), f"{FILE} there is of another version; give the run's own command again")
    return command


@contextmanager
def damage_explained(path: Path) -> Iterator[None]:
    """Say that the file `path` is damaged where what it holds cannot be used.

    Raises:
        RequestError: so it is.
    """
    try:
        yield
    except McaError:
        raise
    except DAMAGE as error:
        remedy = f"{FILE} there is damaged or of another version; run again with --force (force=True)"
        raise bad_value("out", str(path.parent), remedy) from error


def _read(path: Path) -> tuple[dict[str, Any], dict[str, NDArray]]:
    """Header and arrays that `Checkpoint.store` added to a state.

    Raises:
        RequestError: the file is damaged.
    """
    with damage_explained(path):
        with np.load(path, allow_pickle=False) as archive:
            head = json.loads(archive[HEADER].tobytes())
            more = {name.removeprefix(MORE): archive[name] for name in archive.files if name.startswith(MORE)}
        if not (isinstance(head["request"], dict) and isinstance(head["place"], dict) and "command" in head):
            raise ValueError(head)
    return head, more
