"""Owns the coordinate systems of a Nastran file: places of grid points in straight, cylindrical and spherical ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


class Systems:
    """The systems of a file by number, and where they lie.

    Each is given by its origin A, a point B on its z axis and a point C in its half plane of x > 0, y = 0, in another
    system (CORD2R, CORD2C, CORD2S) or as grid points (CORD1R, CORD1C, CORD1S); MSC Nastran Quick Reference Guide.
    """

    def __init__(self, grid_point: Callable[[int], Vector]) -> None:
        """Args: `grid_point`: place of a grid point in the basic system."""
        self._grid_point = grid_point
        self._given: dict[int, tuple[str, Callable[[], list[Vector]]]] = {}
        self._known: dict[int, tuple[str, Vector, NDArray[np.float64]]] = {}
        self._open: list[int] = []

    def by_points(self, number: int, name: str, reference: int, points: Sequence[float]) -> None:
        """A system of the card `name` by A, B and C, nine coordinates in the system `reference`."""
        rows = np.array(points, dtype=np.float64).reshape(3, 3)
        self._add(number, name, lambda: [self.place(reference, row) for row in rows])

    def by_grid_points(self, number: int, name: str, points: Sequence[int]) -> None:
        """A system of the card `name` by the numbers of three grid points."""
        self._add(number, name, lambda: [self._grid_point(point) for point in points])

    def _add(self, number: int, name: str, points: Callable[[], list[Vector]]) -> None:
        if number in self._given:
            raise ValueError(f"coordinate system {number} is given twice")
        self._given[number] = name, points

    def place(self, number: int, coordinates: Sequence[float] | Vector) -> Vector:
        """A place in the basic system, from coordinates in the system `number`; angles in degrees.

        Raises:
            ValueError: the system is not given, or cannot be read.
        """
        a, b, c = map(float, coordinates)
        if number == 0:
            return np.array([a, b, c])
        kind, origin, axes = self._frame(number)
        theta, phi = np.radians(b), np.radians(c)
        if kind == "C":
            local = np.array([a * np.cos(theta), a * np.sin(theta), c])
        elif kind == "S":
            local = a * np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
        else:
            local = np.array([a, b, c])
        return origin + axes @ local

    def _frame(self, number: int) -> tuple[str, Vector, NDArray[np.float64]]:
        """Kind, origin and axes, as columns, of a system."""
        if number in self._known:
            return self._known[number]
        if number not in self._given:
            raise ValueError(f"coordinate system {number} is not given")
        name, points = self._given[number]
        if name[4:] not in ("1R", "1C", "1S", "2R", "2C", "2S"):
            raise ValueError(f"coordinate system {number}: {name} is not read")
        if number in self._open:
            raise ValueError(f"coordinate system {number} ({name}) is defined by itself")
        self._open.append(number)
        origin, on_z, in_xz = points()
        self._open.remove(number)
        z = on_z - origin
        y = np.cross(z, in_xz - origin)
        if not np.linalg.norm(y) > 0.0:
            raise ValueError(f"coordinate system {number} ({name}): its three points lie in one line")
        z, y = z / np.linalg.norm(z), y / np.linalg.norm(y)
        self._known[number] = name[-1], origin, np.column_stack([np.cross(y, z), y, z])
        return self._known[number]
