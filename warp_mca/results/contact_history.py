"""Owns the history of each contact (forces.npz), and its figures in the summary."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.results.force_history import contact_intervals, unfinished
from warp_mca.results.npz import load_histories, save_histories

Array = NDArray[np.float64]

ONE_WAY = 0.1  # least share of the normal forces that their vector sum keeps, for them to have a direction
_COLUMNS = {  # arrays of forces.npz, and the attributes of `ContactHistory` that they hold
    "force_N": "force",
    "pressure_N": "pressure",
    "normal_force_N": "normal_force",
    "closing_speed": "closing_speed",
}


@dataclass(frozen=True, kw_only=True)
class ContactHistory:
    """One contact of the scene in every output interval. Forces act on the slave; those of both passes count.

    A general contact has only `pressure` and `closing_speed`: its forces on all bodies add up to zero.

    Attributes:
        name: of the contact, see `contact_names`.
        force: whole force, mean over the interval [N], shape (row_count, 3), float64.
        pressure: normal forces of all slave nodes, added up as they are, mean over the interval [N], shape
            (row_count,), float64.
        normal_force: vector sum of the normal forces at the end of the interval [N], shape (row_count, 3), float64.
        closing_speed: speed at which the touching surfaces approach each other along their normal, mean over the
            interval and over the nodes that touch, weighted with their normal forces [m/s], shape (row_count,),
            float64; negative while they part, nan where nothing touched and in the first row.
    """

    name: str
    force: Array
    pressure: Array
    normal_force: Array
    closing_speed: Array

    def at(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> ContactHistory:
        """The same in some output intervals: their numbers, shape (count,), or whether each is, shape (row_count,)."""
        return ContactHistory(
            name=self.name,
            force=self.force[rows],
            pressure=self.pressure[rows],
            normal_force=self.normal_force[rows],
            closing_speed=self.closing_speed[rows],
        )

    @property
    def normal(self) -> Array | None:
        """Direction of the normal impulse on the slave [-], shape (3,), or None where it has none.

        It has none without contact, and where normal forces cancel, as around a clamped body.
        """
        total = self.normal_force.sum(axis=0)
        size, most = np.linalg.norm(total), np.linalg.norm(self.normal_force, axis=1).sum()
        return total / size if size > ONE_WAY * most else None

    @property
    def touched(self) -> bool:
        """Whether the surfaces pressed on each other."""
        return bool(self.pressure.max(initial=0.0) > 0.0)

    @property
    def unfinished(self) -> bool:
        """Whether the contact was still in progress in the last row."""
        return unfinished(self.pressure)

    def summary(self, time: Array) -> dict[str, Any]:
        """What `contacts_by_pair` of the summary says of it.

        Args:
            time: ends of the output intervals [s], shape (row_count,).
        """
        size = np.linalg.norm(self.force, axis=1)
        step = float(time[1] - time[0]) if len(time) > 1 else 0.0
        return {
            "name": self.name,
            "intervals": [list(span) for span in contact_intervals(time, self.pressure)],
            "contact_open_at_end": self.unfinished,
            "F_max": self.force[int(np.argmax(size))].tolist() if len(size) else [0.0, 0.0, 0.0],
            "impulse": (step * self.force.sum(axis=0)).tolist(),
            "normal": None if self.normal is None else self.normal.tolist(),
        }


def save_contacts(file: Path, time: Array, contacts: Sequence[ContactHistory]) -> None:
    """Write time_s, and for each contact NAME/force_N and the other arrays of `ContactHistory`, as an npz archive."""
    columns = {contact.name: {key: getattr(contact, field) for key, field in _COLUMNS.items()} for contact in contacts}
    save_histories(file, time, columns)


def load_contacts(file: str | os.PathLike[str]) -> tuple[ContactHistory, ...]:
    """The contacts that `save_contacts` wrote."""
    found = load_histories(file, *_COLUMNS)
    return tuple(
        ContactHistory(name=name, **dict(zip(_COLUMNS.values(), columns, strict=True)))
        for name, columns in found.items()
    )
