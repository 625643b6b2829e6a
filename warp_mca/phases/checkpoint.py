"""Owns checkpoints: how often a run stores its state, and the file from which the same request goes on."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import McaError, bad_value
from warp_mca.base.log import warn
from warp_mca.base.validate import DAMAGE

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact
    from warp_mca.phases.settings import Settings
    from warp_mca.recorders.recorder import Recorder
    from warp_mca.scene import Scene
    from warp_mca.step.steps import Steps

FILE = "checkpoint.npz"
METHOD = "pure-fem"  # whose runs store their state by default
METHODS = ("mca", METHOD)
DEFAULT = "30w"
HEADER, MORE = "run/header", "run/more/"  # in that file, beside the arrays of the state
REMEDY = "write it as 100 (steps), 2e-5s (simulated seconds) or 30w (seconds of wall time)"
LEAST, MOST = 1e-12, 1e12  # what can be asked for, of any unit
_LETTER = {"steps": "", "simulated": "s", "wall": "w"}
SHORTEST = 4.0  # parts into which the time between two checkpoints is cut at least, to hit it


@dataclass(frozen=True)
class Every:
    """How often the state is stored: each `count` [steps, or s] of a `unit`, at the end of an output interval.

    `command` is what `warp-mca resume` needs to give the request again, as JSON can hold it; None for a Python program.
    """

    count: float
    unit: Literal["steps", "simulated", "wall"]
    command: Mapping[str, Any] | None = None

    @property
    def text(self) -> str:
        """As the user writes it."""
        return f"{self.count:g}{_LETTER[self.unit]}"

    @staticmethod
    def parse(value: object, command: Mapping[str, Any] | None = None) -> Every:
        """What `--checkpoint` means.

        Raises:
            RequestError: it is not of one of the three forms, or out of range.
        """
        text = str(value).strip()
        unit: Literal["steps", "simulated", "wall"]
        unit = "simulated" if text.endswith("s") else "wall" if text.endswith("w") else "steps"
        try:
            count = float(text if unit == "steps" else text[:-1])
        except ValueError:
            count = math.nan
        if not LEAST <= count <= MOST or (unit == "steps" and count != int(count)):
            raise bad_value("checkpoint", validate.brief(value), REMEDY)
        return Every(count, unit, command)


def every_of(
    method: object,
    checkpoint: str | Every | None,
    out: str | os.PathLike[str] | None,
    scene: Scene,
    recorders: Sequence[Recorder],
) -> Every | None:
    """How often a run stores its state, by what the user gave; None: never.

    Raises:
        RequestError: the method is unknown, or the run cannot store its state.
    """
    if method not in METHODS:
        raise bad_value("method", validate.brief(method), f"choose {' or '.join(METHODS)}")
    if checkpoint is None and (method != METHOD or out is None):
        every = None
    else:
        every = checkpoint if isinstance(checkpoint, Every) else Every.parse(checkpoint or DEFAULT)
    if every is None and method != METHOD:
        return None
    asked = "method" if method == METHOD else "checkpoint"
    value = method if method == METHOD else checkpoint.text if isinstance(checkpoint, Every) else checkpoint
    if recorders:
        raise bad_value(asked, value, "recordings cannot be continued from a stored state; leave recorders out")
    if scene.t_end is not None:
        raise bad_value(asked, value, "a run of swings and impacts in turn stores no state; leave t_end out")
    if every and out is None:
        raise bad_value(asked, value, "the state needs a folder; name one by out")
    return every


class Checkpoint:
    """The file in a run's folder. It is replaced by rename, so that it is whole whenever a run is stopped.

    Attributes:
        path: of the file.
        every: how often it is written.
    """

    def __init__(self, folder: Path, every: Every, force: bool = False) -> None:
        """Of the folder of a run; with `force` the run begins anew."""
        self.path, self.every, self.request = folder / FILE, every, {}
        self._steps, self._time, self._rate, self._begun = 0, time.perf_counter(), 0.0, 0
        self._failed = False  # the last time: a warning says so once
        if force:
            self.path.unlink(missing_ok=True)

    def is_for(self, impact: Impact, span: float, settings: Settings, method: str) -> None:
        """Say what the run is, `span` [s] of impact: another one does not go on from its file."""
        from warp_mca.step.state import digest  # which imports Warp, that the command line need not

        ready, solver = impact.ready[0], impact.solver
        self.request = {
            "method": method,
            "model": digest(solver.model),
            "paths": digest(ready.probes),
            "sensors": digest(ready.sensors),
            "impact": repr(ready.scene.impact),
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
        return (now // steps.per_interval + max(1, math.ceil(ahead / steps.per_interval))) * steps.per_interval

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

    def stored(self) -> tuple[dict[str, Any], dict[str, NDArray]] | None:
        """Place and arrays that an earlier run of the same request stored, or None.

        Raises:
            RequestError: the file is damaged or of another request.
        """
        if not self.path.exists():
            return None
        head, more = _read(self.path)
        if head["request"] != self.request:
            other = next(key for key in self.request if head["request"].get(key) != self.request[key])
            remedy = f"{FILE} there is of another request ({other}); name another folder, or use --force (force=True)"
            raise bad_value("out", str(self.path.parent), remedy)
        return head["place"], more

    def remove(self) -> None:
        """Remove the file of a run that is over."""
        self.path.unlink(missing_ok=True)

    def _wanted(self, steps: Steps) -> int:
        """Steps from one checkpoint to the next."""
        return max(1, round(self.every.count if self.every.unit == "steps" else self.every.count / steps.dt))


def advance(impact: Impact, checkpoint: Checkpoint, told: Callable[[], None]) -> None:
    """Advance an impact phase to its end, from where an earlier run of the same request was, and store it on the way.

    Raises:
        RequestError: the folder holds the state of another request.
    """
    if checkpoint.stored() is not None:
        impact.load(checkpoint.path)
    go_on(impact, checkpoint, told, lambda: checkpoint.store(impact, {}))


def go_on(impact: Impact, checkpoint: Checkpoint | None, told: Callable[[], None], store: Callable[[], None]) -> None:
    """Advance to the end, and `store` as often as the checkpoint says."""
    if checkpoint:
        checkpoint.begin(impact)
    while checkpoint and impact.stopped[0] is None and (stop := checkpoint.next_stop(impact)) < impact.steps.count:
        impact.advance(until=stop, told=told)
        if impact.stopped[0] is None and checkpoint.is_due(impact):
            store()
    impact.advance(told=told)


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
