"""Owns what a row of the table of extremes is: a scene at one value of a parameter, and what its run must give."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar

import warp_mca as mca

Level = Literal["quick", "full", "long"]
Value = float | int | str


@dataclass(frozen=True)
class Figure:
    """One quantity of a run beside what it should be.

    Attributes:
        name: in a few words.
        measured, exact: in the same unit.
        tolerance: largest error that the mesh and the theory explain, as a share of `scale`.
        scale: what errors are shares of; |exact| if None.
    """

    name: str
    measured: float
    exact: float
    tolerance: float
    scale: float | None = None

    @property
    def error(self) -> float:
        """Relative error; not a number where `measured` is not."""
        return abs(self.measured - self.exact) / (abs(self.exact) if self.scale is None else self.scale)


@dataclass(frozen=True)
class Trial:
    """A scene at one value of a parameter.

    Attributes:
        scene: to run, with any element.
        read: figures of its result.
        options: further arguments of `mca.run`.
        forced: how many times longer the step is than what the scene asks for, past all checks.
    """

    scene: mca.Scene
    read: Callable[[mca.Result], list[Figure]]
    options: Mapping[str, Any] = field(default_factory=dict)
    forced: float = 1.0


@dataclass(frozen=True)
class Direct:
    """A measurement that needs no run.

    Attributes:
        measure: figures and number of steps, with a precision, on a device.
        unit: of the figures, whose errors are shown in it.
    """

    measure: Callable[[str, str], tuple[list[Figure], int]]
    unit: str


@dataclass(frozen=True)
class Axis:
    """A table: one parameter over its range.

    Attributes:
        name: as the command line takes it.
        group: heading that lists it.
        title: what is varied, in a line.
        reference: scene, and where the exact values come from.
        values: of the parameter.
        build: the trial at a value and with an element; it may raise `RequestError`.
        level: "full" is part of the usual table, "long" takes minutes a cell.
        elements: that it is run with; all if None.
        quick: values that the quick level takes.
    """

    name: str
    group: str
    title: str
    reference: str
    values: tuple[Value, ...]
    build: Callable[[Any, str], Trial | Direct]
    level: Level = "full"
    elements: tuple[str, ...] | None = None
    quick: tuple[Value, ...] = ()


Builds = TypeVar("Builds", Trial, Direct)
AXES: dict[str, Axis] = {}
# In the order of the page.
GROUPS = (
    "bars",
    "steps",
    "two bodies",
    "material",
    "contact",
    "through each other",
    "options",
    "motion",
    "rotations",
    "arm",
)


def ordered_axes() -> list[Axis]:
    """All axes in the order of the page, whatever was imported first."""
    return sorted(AXES.values(), key=lambda item: GROUPS.index(item.group))


def axis(
    *,
    group: str,
    title: str,
    reference: str,
    values: tuple[Value, ...],
    level: Level = "full",
    elements: tuple[str, ...] | None = None,
    quick: tuple[Value, ...] = (),
) -> Callable[[Callable[[Any, str], Builds]], Callable[[Any, str], Builds]]:
    """Register the function below as the builder of the axis of its name."""

    def register(build: Callable[[Any, str], Builds]) -> Callable[[Any, str], Builds]:
        name: str = build.__name__  # type: ignore[attr-defined]
        assert name not in AXES, name
        assert set(quick) <= set(values), name
        AXES[name] = Axis(name, group, title, reference, values, build, level, elements, quick)
        return build

    return register


def with_element(scene: mca.Scene, element: str) -> mca.Scene:
    """The scene with every body made of an element."""
    return replace(scene, bodies=tuple(replace(body, element=element) for body in scene.bodies))
