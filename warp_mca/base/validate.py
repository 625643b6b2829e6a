"""Owns the checks of user input: values of scenes, recipes and runs, results of user code, damaged files."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
import struct
import tokenize
import traceback
import zipfile
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import pairwise
from numbers import Integral, Real
from pathlib import Path
from types import NoneType
from typing import Any, TypeGuard

import numpy as np

from warp_mca.base.errors import McaError, bad_value

# What reading a damaged file can raise, from the archive down to the checks of the classes that are made from it.
# `zipfile` raises RuntimeError where a damaged byte says encrypted, or packed in a way that it does not know; NumPy's
# reader of headers raises TokenError and SyntaxError, and MemoryError where the shape is damaged; JSON RecursionError.
DAMAGE = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    AttributeError,
    ArithmeticError,
    MemoryError,
    RuntimeError,
    SyntaxError,
    tokenize.TokenError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)

SHORTEST, LONGEST = 1e-15, 1e9  # times that users may give [s]
TIME = f"give a finite time from {SHORTEST:g} to {LONGEST:g} s"
_PLAIN = frozenset((float, str, bool, NoneType))
MAX_COUNT = 1_000_000_000  # upper limit of every count that users give; memory runs out before


def plain(item: Any) -> None:
    """Convert numbers and sequences in the fields of a dataclass to Python's float, int, bool and tuple.

    NumPy arrays, lists and fractions then compare, hash and print like the numbers that they stand for. A number stays
    an int only in a field whose annotation says int. All other values stay as they are, for the checks that follow.
    """
    for name, whole in _fields(type(item)):
        value = getattr(item, name)
        if type(value) in _PLAIN:
            continue
        value = value.tolist() if isinstance(value, np.ndarray) else value
        if _is_sequence(value):
            value = tuple(_plain_number(entry, whole) for entry in value)
        object.__setattr__(item, name, _plain_number(value, whole))


@lru_cache(maxsize=1024)
def _fields(kind: type) -> tuple[tuple[str, bool], ...]:
    """Fields of a dataclass, and whether the annotation of each says int."""
    return tuple((field.name, re.search(r"\bint\b", str(field.type)) is not None) for field in dataclasses.fields(kind))


def _plain_number(value: object, whole: bool) -> object:
    if type(value) in _PLAIN:
        return value
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, Real) and not isinstance(value, bool):
        with suppress(OverflowError):  # no float holds it
            return int(value) if whole and isinstance(value, Integral) else float(value)
    return value


def positive(owner: str, /, **values: float) -> None:
    """Each value must be a finite number above 0."""
    for name, value in values.items():
        if not (is_number(value) and value > 0.0):
            raise bad_value(f"{owner}.{name}", value, "give a finite number above 0")


def within(owner: str, low: float, high: float, /, **values: float) -> None:
    """Each value must be a number from `low` to `high`, limits beyond which nobody means what is typed."""
    for name, value in values.items():
        if not (is_number(value) and low <= value <= high):
            raise bad_value(f"{owner}.{name}", brief(value), f"give a number from {low:g} to {high:g}")


def times(owner: str, /, **values: float) -> None:
    """Each value must be a time that a run can have [s]."""
    for name, value in values.items():
        if not is_time(value):
            raise bad_value(f"{owner}.{name}", brief(value), TIME)


def finite(owner: str, /, **values: float) -> None:
    """Each value must be a finite number."""
    for name, value in values.items():
        if not is_number(value):
            raise bad_value(f"{owner}.{name}", value, "give a finite number")


def counts(owner: str, /, **values: int) -> None:
    """Each value must be a whole number above 0."""
    for name, value in values.items():
        if not _is_count(value):
            raise bad_value(f"{owner}.{name}", value, f"give a whole number above 0, at most {MAX_COUNT:,}")


def even_counts(owner: str, /, **values: int) -> None:
    """Each value must be an even number above 0, so that the middle is a grid line."""
    for name, value in values.items():
        if not (_is_count(value) and value % 2 == 0):
            raise bad_value(f"{owner}.{name}", value, f"give an even number above 0, at most {MAX_COUNT:,}")


def flags(owner: str, /, **values: bool) -> None:
    """Each value must be True or False."""
    kinds(owner, bool, "give True or False", **values)


def entries(owner: str, count: int, check: Callable[..., None], /, **values: tuple) -> None:
    """Each value must be a tuple of `count` entries that pass a check of this module."""
    for name, value in values.items():
        if not (isinstance(value, (tuple, list)) and len(value) == count):
            raise bad_value(f"{owner}.{name}", value, f"give {count} numbers")
        for entry in value:
            check(owner, **{name: entry})


def vectors(owner: str, /, **values: Sequence[float]) -> None:
    """Each value must be three finite numbers."""
    for name, value in values.items():
        if not (is_list(value) and len(value) == 3):
            raise bad_value(f"{owner}.{name}", value, "give three finite numbers")


def directions(owner: str, /, **values: Sequence[float]) -> None:
    """Each value must be three finite numbers that are not all zero."""
    vectors(owner, **values)
    for name, value in values.items():
        if not any(value):
            raise bad_value(f"{owner}.{name}", value, "give a direction other than zero")


def table(owner: str, times: Sequence[float], /, **values: Sequence[float]) -> None:
    """Times must increase, and each value must hold one finite number for each of them."""
    for name, column in (("times", times), *values.items()):
        if not is_list(column):
            raise bad_value(f"{owner}.{name}", column, "give finite numbers")
        if len(column) != len(times) or not len(times):
            raise bad_value(f"{owner}.{name}", column, "give one value for each time")
    if any(b <= a for a, b in pairwise(times)):
        raise bad_value(f"{owner}.times", times, "list them in increasing order")


def choice(owner: str, options: Sequence[str], /, **values: str) -> None:
    """Each value must be one of the options."""
    for name, value in values.items():
        if value not in options:
            words = f"{', '.join(options[:-1])} or {options[-1]}"
            raise bad_value(f"{owner}.{name}", value, f"choose {words}")


def unique(field: str, names: Sequence[str], what: str) -> None:
    """The names in that field must differ."""
    if len(set(names)) < len(names):
        raise bad_value(field, names, f"give each {what} a name of its own")


def kinds(owner: str, kind: type | tuple[type, ...], remedy: str, /, **values: object) -> None:
    """Each value must be an instance of `kind`."""
    for name, value in values.items():
        kind_of(f"{owner}.{name}", value, kind, remedy)


def texts(owner: str, /, **values: str) -> None:
    """Each value must be a text that files can hold."""
    kinds(owner, str, "give a text", **values)
    for name, value in values.items():
        if not value.isascii() and value != value.encode(errors="replace").decode():  # half of a character
            raise bad_value(f"{owner}.{name}", value, "give a text that UTF-8 can encode")


def members(owner: str, kind: type | tuple[type, ...], /, **values: Sequence[object]) -> None:
    """Each value must be a tuple or list of instances of `kind`."""
    kinds_named = " or a ".join(one.__name__ for one in (kind if isinstance(kind, tuple) else (kind,)))
    for name, value in values.items():
        kind_of(f"{owner}.{name}", value, (tuple, list), f"give a tuple of {kinds_named}")
        for k, item in enumerate(value):
            kind_of(f"{owner}.{name}[{k}]", item, kind, f"give a {kinds_named}")


def kind_of(field: str, value: object, kind: type | tuple[type, ...], remedy: str) -> None:
    """The value of that field must be an instance of `kind`."""
    if not isinstance(value, kind):
        raise bad_value(field, brief(value), remedy)


def brief(value: object) -> object:
    """The value for a message, or the name of its class where it may be long; `bad_value` shortens sequences."""
    entries = value if isinstance(value, tuple | list) else (value,)
    return value if all(entry is None or isinstance(entry, str | Real) for entry in entries) else type(value).__name__


def call(field: str, value: object, what: str, function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """Call a user's function and return its result.

    Args:
        field, value: that the function belongs to, for the message.
        what: name of the function, for the message.
        function, args, kwargs: what to call.

    Raises:
        RequestError: it raised something else than an McaError.
    """
    try:
        found = function(*args, **kwargs)
    except McaError:
        raise
    except (Exception, SystemExit) as error:  # user code may raise anything, SystemExit included
        line = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(line.filename).name}, line {line.lineno}"
        words = " ".join(f"{type(error).__name__}: {error}".split())
        raise bad_value(field, value, f"{what} failed with {words} ({where})") from error
    if inspect.iscoroutine(found):
        found.close()  # or Python warns that nobody awaited it
    return found


def is_number(value: object) -> bool:
    """Whether it is a finite real number; text, None, sequences and booleans are not."""
    if type(value) is float:  # most are, and asking an abstract class takes long
        return math.isfinite(value)
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # a whole number that no float holds
        return False


def is_time(value: object) -> bool:
    """Whether it is a time that a run can have [s]."""
    return is_number(value) and SHORTEST <= value <= LONGEST  # pyright: ignore[reportOperatorIssue]


def is_list(value: object) -> bool:
    """Whether it is a sequence of finite numbers; sets, mappings and generators cannot be indexed and are not."""
    if isinstance(value, np.ndarray):
        return value.ndim == 1 and all(map(is_number, value))
    return _is_sequence(value) and all(map(is_number, value))


def _is_sequence(value: object) -> TypeGuard[Sequence[object]]:
    if type(value) is tuple:
        return True
    return isinstance(value, Sequence) and not isinstance(value, str | bytes | bytearray | memoryview)


def _is_count(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool) and 0 < int(value) <= MAX_COUNT
