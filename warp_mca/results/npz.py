"""Owns npz archives of several histories over the same times, such as forces.npz and paths.npz."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def save_histories(file: Path, time: NDArray[np.float64], histories: Mapping[str, Mapping[str, NDArray]]) -> None:
    """Write `time` [s] as time_s, and each array of each history as HISTORY/ARRAY, in the order given."""
    arrays: dict[str, NDArray] = {"time_s": time}
    for name, columns in histories.items():
        arrays |= {f"{name}/{key}": column for key, column in columns.items()}
    with file.open("wb") as stream:
        np.savez(stream, **arrays)  # pyright: ignore[reportArgumentType]


def load_histories(file: str | os.PathLike[str], *columns: str) -> dict[str, tuple[NDArray, ...]]:
    """Arrays that `save_histories` wrote: those named `columns` of each history, by its name.

    Raises:
        KeyError: a history has the first column and lacks another.
    """
    with np.load(file) as arrays:
        suffix = f"/{columns[0]}"
        names = [key.removesuffix(suffix) for key in arrays if key.endswith(suffix)]
        return {name: tuple(arrays[f"{name}/{column}"] for column in columns) for name in names}
