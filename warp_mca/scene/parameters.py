"""Owns the parameters of scenes: type, unit, limits, and the conversion of texts to values."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from warp_mca.base.errors import bad_value

LEAST, MOST = 1e-30, 1e30  # sizes of numbers that somebody may mean, in any unit
TRUE = ("true", "yes", "on", "1")
FALSE = ("false", "no", "off", "0")
KIND_WORDS = {float: "a finite number", int: "a whole number", str: "a word", bool: "true or false"}


@dataclass(frozen=True)
class Param:
    """What a scene tells about one of its parameters, as metadata of `Annotated[type, Param(...)]`.

    Attributes:
        description: in a few words.
        unit: of the value, "-" when it has none.
        low, high: smallest and largest value, themselves allowed unless `exclusive`; None where there is no limit.
        exclusive: the limits themselves are not allowed.
        choices: the only values allowed, or empty.
        words: texts that are allowed in place of a number.
    """

    description: str = ""
    unit: str = "-"
    low: float | None = None
    high: float | None = None
    exclusive: bool = False
    choices: tuple[str, ...] = ()
    words: tuple[str, ...] = ()

    @property
    def range(self) -> str:
        """The values allowed, in words: "above 0", "0 to 10", "slender or mesh"; empty when all are."""
        return " or ".join([self._numbers or "any", *self.words]) if self.words else self._numbers

    @property
    def _numbers(self) -> str:
        if self.choices:
            return " or ".join(self.choices)
        if self.low is not None and self.high is not None:
            return ("between {:g} and {:g}" if self.exclusive else "{:g} to {:g}").format(self.low, self.high)
        if self.low is not None:
            return f"above {self.low:g}" if self.exclusive else f"{self.low:g} or above"
        if self.high is not None:
            return f"below {self.high:g}" if self.exclusive else f"{self.high:g} or below"
        return ""

    def allows(self, value: object) -> bool:
        """Whether `value`, of the right type already, lies within choices and limits."""
        if self.choices:
            return value in self.choices
        if not isinstance(value, int | float):
            return True
        above = self.low is None or (value > self.low if self.exclusive else value >= self.low)
        return above and (self.high is None or (value < self.high if self.exclusive else value <= self.high))


@dataclass(frozen=True)
class Parameter:
    """One parameter of a scene: its name, its type (float, int, str or bool), its default and what is allowed."""

    name: str
    kind: type
    default: object
    param: Param

    def checked(self, value: object) -> object:
        """`value`, or the text of one, as this parameter's type and within its limits.

        Raises:
            RequestError: it is neither.
        """
        if self.default is None and (value is None or value == "none"):
            return None
        if isinstance(value, str) and value in self.param.words:
            return value
        try:
            result = _converted(value, self.kind)
        except (TypeError, ValueError, OverflowError):
            raise bad_value(self.name, value, self._remedy()) from None
        if not self.param.allows(result):
            raise bad_value(self.name, result, self._remedy())
        if isinstance(result, int | float) and result and not LEAST <= abs(result) <= MOST:
            raise bad_value(self.name, result, f"{self._remedy()}; of a size from {LEAST:g} to {MOST:g}")
        return result

    def _remedy(self) -> str:
        unit = f" [{self.param.unit}]" if self.param.unit != "-" else ""
        if self.param.choices:
            return f"choose {self.param.range}"
        none = ", or none" if self.default is None else ""
        return f"give {KIND_WORDS[self.kind]}{unit}" + (f", {self.param.range}" if self.param.range else "") + none


def _converted(value: object, kind: type) -> object:
    if kind is bool:
        word = str(value).lower()
        if word not in TRUE + FALSE:
            raise ValueError(word)
        return word in TRUE
    if isinstance(value, bool) or value is None:
        raise TypeError(value)
    if kind is str:
        return str(value)
    number: Any = value
    result = float(number)
    if not math.isfinite(result):
        raise ValueError(value)
    if kind is int and not result.is_integer():
        raise ValueError(value)
    return kind(result)
