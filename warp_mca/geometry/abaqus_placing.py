"""Owns where *INSTANCE puts a part: a translation, then a rotation about a line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.rotation import rotation_matrix

Place = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Placing:
    """x -> R (x + shift - point) + point.

    Attributes:
        shift: in the file's unit, shape (3,), float64.
        turn: R, shape (3, 3), float64, or None for none.
        point: of the axis, in the file's unit, shape (3,), float64.
    """

    shift: Array
    turn: Array | None
    point: Array

    @classmethod
    def of(cls, rows: Sequence[Sequence[float]]) -> Placing:
        """From the data lines of *INSTANCE: a translation; two points of an axis and an angle in degrees.

        Raises:
            ValueError: they are not of that form.
        """
        rows = [row for row in rows if row]
        if len(rows) > 2 or (rows and len(rows[0]) > 3) or (len(rows) > 1 and len(rows[1]) != 7):
            raise ValueError("*INSTANCE takes a translation and, in a second line, two points of an axis and an angle")
        shift = np.zeros(3)
        if rows:
            shift[: len(rows[0])] = rows[0]
        if len(rows) < 2 or not rows[1][6]:
            return cls(shift, None, np.zeros(3))
        start, end = np.array(rows[1][:3]), np.array(rows[1][3:6])
        if not (length := float(np.linalg.norm(end - start))):
            raise ValueError("the two points of the axis of an *INSTANCE are one")
        return cls(shift, rotation_matrix(math.radians(rows[1][6]) * (end - start) / length), start)

    def place(self, x: float, y: float, z: float) -> Place:
        """Where the instance has a node of the part."""
        if self.turn is None and not self.shift.any():
            return x, y, z
        at = np.array([x, y, z]) + self.shift
        if self.turn is not None:
            at = self.turn @ (at - self.point) + self.point
        return float(at[0]), float(at[1]), float(at[2])


UNMOVED = Placing(np.zeros(3), None, np.zeros(3))
