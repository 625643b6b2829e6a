"""Owns where a run records: points and paths."""

from __future__ import annotations

import math
from dataclasses import dataclass

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bodies import Vec3


@dataclass(frozen=True, kw_only=True)
class Point:
    """A material point: the mesh node of `body` that lies nearest to `at` [m] in the body's frame."""

    body: str
    at: Vec3

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Point", body=self.body)
        validate.vectors(f"Point of {self.body}", at=self.at)


@dataclass(frozen=True, kw_only=True)
class Line:
    """A straight part of a path.

    Attributes:
        body: that it runs through.
        start, end: its ends in the body's frame [m].
        position: of its start along the path [m].
    """

    body: str
    start: Vec3
    end: Vec3
    position: float = 0.0

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Line", body=self.body)
        validate.vectors(f"Line in {self.body}", start=self.start, end=self.end)
        if not validate.is_number(self.position):
            raise bad_value(f"Line in {self.body}.position", self.position, "give a finite number")
        if self.start == self.end:
            raise bad_value(f"Line in {self.body}.end", self.end, "give a point other than the start")

    @property
    def length(self) -> float:
        """[m]."""
        return math.dist(self.start, self.end)


@dataclass(frozen=True, kw_only=True)
class Path:
    """Probes along lines, at which stress is recorded in every output interval.

    Attributes:
        name: unique in the scene.
        lines: its parts.
        spacing: largest distance between neighbouring probes of a line [m].
        title: what it is, such as "upper surface", for the panels of figures; None for the name alone.
    """

    name: str
    lines: tuple[Line, ...]
    spacing: float
    title: str | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Path", name=self.name)
        validate.positive(f"Path {self.name}", spacing=self.spacing)
        validate.members(f"Path {self.name}", Line, lines=self.lines)
        if not self.lines:
            raise bad_value(f"Path {self.name}.lines", self.lines, "give at least one line")
        if self.title is not None:
            validate.texts(f"Path {self.name}", title=self.title)

    @property
    def heading(self) -> str:
        """Of its panel in figures: the name, and what it is."""
        return self.name if self.title is None else f"{self.name}: {self.title}"
