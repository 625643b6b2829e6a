"""Owns how often a run stores its state, and which runs can."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from warp_mca.base import validate
from warp_mca.base.errors import bad_value

if TYPE_CHECKING:
    from warp_mca.recorders.recorder import Recorder

METHOD = "pure-fem"  # whose runs store their state by default
METHODS = ("mca", METHOD)
DEFAULT = "30w"

REMEDY = "write it as 100 (steps), 2e-5s (simulated seconds) or 30w (seconds of wall time)"
LEAST, MOST = 1e-12, 1e12  # what can be asked for, of any unit
_LETTER = {"steps": "", "simulated": "s", "wall": "w"}


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
    if every and out is None:
        raise bad_value(asked, value, "the state needs a folder; name one by out")
    return every
