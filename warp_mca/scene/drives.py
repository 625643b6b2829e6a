"""Owns prescribed motion of nodes: axes that keep their initial velocity or follow a table."""

from __future__ import annotations

from dataclasses import dataclass

from warp_mca.base import validate
from warp_mca.base.errors import bad_value


@dataclass(frozen=True, kw_only=True)
class Fixed:
    """Nodes of a set that keep their initial velocity along some axes: no acceleration there.

    Attributes:
        body: body that owns the set.
        nodes: node set of its mesh.
        axes: any of the letters x, y, z in the world frame.
    """

    body: str
    nodes: str
    axes: str = "xyz"

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Fixed", body=self.body, nodes=self.nodes)
        if not isinstance(self.axes, str) or not self.axes or set(self.axes) - set("xyz"):
            raise bad_value(f"Fixed of {self.body}.axes", self.axes, "use letters out of x, y and z")


@dataclass(frozen=True, kw_only=True)
class Prescribed:
    """Nodes of a set whose velocity along one axis follows a table, held constant beyond its ends.

    Attributes:
        body: body that owns the set.
        nodes: node set of its mesh.
        axis: one of the letters x, y, z in the world frame.
        times: [s], increasing, counted from the start of the impact phase.
        velocities: [m/s], as many as times.
    """

    body: str
    nodes: str
    axis: str
    times: tuple[float, ...]
    velocities: tuple[float, ...]

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Prescribed", body=self.body, nodes=self.nodes)
        owner = f"Prescribed of {self.body}"
        if self.axis not in ("x", "y", "z"):
            raise bad_value(f"{owner}.axis", self.axis, "use one of x, y and z")
        validate.table(owner, self.times, velocities=self.velocities)
