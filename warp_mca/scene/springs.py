"""Owns springs and dashpots between points of bodies, or a point and the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bodies import Vec3
from warp_mca.scene.loads import LOADS, Load

FARTHEST = 1e9  # place that anybody means [m]
Table = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Spring(Load):
    """Spring and dashpot that pull two points together by the tension T = preload + T_s(L - length) + T_d(dL/dt).

    Each point is one of a body, or the mass centre of a node set. The second one may be on the ground. L is the
    distance between them, or its part along `direction`. Tables of T_s and T_d go on beyond their ends with the slope
    there. They hold in extension, above 0, and compression, below.

    Attributes:
        name: of the columns `spring_<name>_N`, T, and `spring_<name>_m`, L - length, in the history.
        at, nodes: the first point in the frame of `body` [m], which moves with the element around it; or a node set.
        other: body of the second point; None is the ground.
        other_at, other_nodes: the second point likewise; on the ground, its place [m].
        stiffness: slope of T_s [N/m].
        elongations, forces: T_s as a table in place of stiffness, L - length [m] and tensions [N].
        damping: slope of T_d [N s/m].
        speeds, damping_forces: T_d as a table in place of damping, speeds of elongation [m/s] and tensions [N].
        length: at which T_s is taken at 0 [m]; None is L at the start of the impact phase.
        preload: tension beside T_s [N]; below 0 it pushes. Alone it is a constant force.
        direction: along which L is measured and T acts, fixed in space [-], from the first point to the second one; the
            other way round is turned. None is the line between the points.
    """

    name: str
    at: Vec3 | None = None
    nodes: str | None = None
    other: str | None = None
    other_at: Vec3 | None = None
    other_nodes: str | None = None
    stiffness: float = 0.0
    elongations: Table = ()
    forces: Table = ()
    damping: float = 0.0
    speeds: Table = ()
    damping_forces: Table = ()
    length: float | None = None
    preload: float = 0.0
    direction: Vec3 | None = None

    energies = ("spring", "damping")
    readings = ("spring_{}_N", "spring_{}_m")
    module = "warp_mca.physics.loads.springs"
    on_rigid = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_column("Spring", self.name)
        validate.within(self.title, 0.0, 1e15, stiffness=self.stiffness, damping=self.damping)
        validate.within(self.title, -1e15, 1e15, preload=self.preload)
        self._check_points()
        if self.length is not None:
            validate.within(self.title, -1e9, 1e9, length=self.length)
            if self.length < 0.0 and self.direction is None:
                remedy = "points are never so near; give 0 or more, or the direction along which it is measured"
                raise bad_value(f"{self.title}.length", self.length, remedy)
        if self.direction is not None:
            validate.directions(self.title, direction=self.direction)
        for number, x, y in (("stiffness", "elongations", "forces"), ("damping", "speeds", "damping_forces")):
            if getattr(self, x) != () or getattr(self, y) != ():
                self._check_table(number, x, y)
        if not (any(self.table) or any(self.damper) or self.preload):
            raise bad_value(f"{self.title}.stiffness", self.stiffness, "nothing pulls; give it, damping, or preload")

    def _check_points(self) -> None:
        if self.other is not None:
            validate.texts(self.title, other=self.other)
        for prefix, ground in (("", False), ("other_", self.other is None)):
            at, nodes = getattr(self, f"{prefix}at"), getattr(self, f"{prefix}nodes")
            if ground and nodes is not None:
                raise bad_value(f"{self.title}.other_nodes", nodes, "the ground has none; give other, or other_at")
            if (at is None) == (nodes is None) and not (ground and self.direction is not None):
                remedy = f"give either a point by {prefix}at=(x, y, z) or a node set by {prefix}nodes="
                raise bad_value(f"{self.title}.{prefix}at", at, "give its place" if ground else remedy)
            if at is not None:
                validate.vectors(self.title, **{f"{prefix}at": at})
                if max(map(abs, at)) > FARTHEST:
                    raise bad_value(f"{self.title}.{prefix}at", at, f"give a place within {FARTHEST:g} m")
            if nodes is not None:
                validate.texts(self.title, **{f"{prefix}nodes": nodes})

    def _check_table(self, number: str, x: str, y: str) -> None:
        """Refuse a table that is none, or that stands beside a number."""
        for name in (x, y):
            column = getattr(self, name)
            if not validate.is_list(column) or len(column) < 2:
                raise bad_value(f"{self.title}.{name}", validate.brief(column), "give two finite numbers or more")
            if max(map(abs, column)) > 1e15:
                raise bad_value(f"{self.title}.{name}", max(column, key=abs), "give numbers of 1e15 at most")
        if getattr(self, number):
            raise bad_value(f"{self.title}.{number}", getattr(self, number), f"leave it out, or {x} and {y}")
        xs, ys = getattr(self, x), getattr(self, y)
        if len(xs) != len(ys):
            raise bad_value(f"{self.title}.{y}", len(ys), f"give {len(xs)} numbers, one for each of {x}")
        if any(b - a <= 1e-12 * max(abs(a), abs(b)) for a, b in pairwise(xs)):
            raise bad_value(f"{self.title}.{x}", xs, "list them in increasing order")
        resists = all(speed * force >= 0.0 for speed, force in zip(xs, ys, strict=True))
        if number == "damping" and not (resists and float(np.interp(0.0, xs, ys)) == 0.0):
            remedy = "a dashpot resists: give tension at speeds above 0, negative below, and none at 0"
            raise bad_value(f"{self.title}.{y}", ys, remedy)

    @property
    def is_constant(self) -> bool:
        """It knows no time."""
        return True

    @property
    def table(self) -> tuple[Sequence[float], Sequence[float]]:
        """T_s as a table; empty without."""
        if self.stiffness:
            return (0.0, 1.0), (0.0, self.stiffness)
        return self.elongations, self.forces

    @property
    def damper(self) -> tuple[Sequence[float], Sequence[float]]:
        """T_d as a table; empty without."""
        if self.damping:
            return (0.0, 1.0), (0.0, self.damping)
        return self.speeds, self.damping_forces

    def bodies(self) -> dict[str, str]:
        """Those of its points."""
        return {"body": self.body} | ({} if self.other is None else {"other": self.other})

    def sets(self) -> dict[str, tuple[str, str, bool]]:
        """Those of its points."""
        found = {} if self.nodes is None else {"nodes": (self.body, self.nodes, False)}
        if self.other is not None and self.other_nodes is not None:
            found["other_nodes"] = (self.other, self.other_nodes, False)
        return found


def check_column(kind: str, name: str) -> None:
    """Refuse names that columns of a table cannot have.

    Raises:
        RequestError: it is such a name.
    """
    validate.texts(kind, name=name)
    if name.splitlines() != [name] or set(name) & {",", '"'}:
        remedy = "columns have it; give a word, or some in one line without commas and quotation marks"
        raise bad_value(f"{kind}.name", name, remedy)


LOADS[Spring.__name__] = Spring
