"""Owns prescribed motion of nodes: axes that keep their initial velocity or follow a table."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

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


PIECES = 20  # straight ones of the velocity between two times of a table of displacements


@dataclass(frozen=True, kw_only=True)
class Prescribed:
    """Nodes of a set whose velocity or displacement along one axis follows a table.

    Velocities are linear between the times, constant beyond their ends. Displacements begin and end at rest and have no
    jump of velocity: between two times they are cubic, without overshoot (Fritsch and Carlson, SIAM J. Numer. Anal. 17
    (1980) 238). For corners, give velocities.

    Attributes:
        body: body that owns the set.
        nodes: node set of its mesh.
        axis: one of the letters x, y, z in the world frame.
        times: [s], increasing, counted from the start of the impact phase.
        velocities: [m/s], as many as times; or
        displacements: from the places at the start of the impact phase [m], as many as times, the first 0.
    """

    body: str
    nodes: str
    axis: str
    times: tuple[float, ...]
    velocities: tuple[float, ...] | None = None
    displacements: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Prescribed", body=self.body, nodes=self.nodes)
        owner = f"Prescribed of {self.body}"
        if self.axis not in ("x", "y", "z"):
            raise bad_value(f"{owner}.axis", self.axis, "use one of x, y and z")
        if (self.velocities is None) == (self.displacements is None):
            raise bad_value(f"{owner}.velocities", self.velocities, "give either velocities or displacements")
        if self.velocities is not None:
            validate.table(owner, self.times, velocities=self.velocities)
        if self.displacements is not None:
            validate.table(owner, self.times, displacements=self.displacements)
            if self.times[0] < 0.0 or self.displacements[0] != 0.0:
                first = (self.times[0], self.displacements[0])
                raise bad_value(f"{owner}.displacements", first, "begin with 0 at a time of 0 or later")

    @property
    def velocity_table(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Times [s] and velocities [m/s], which lead to displacements where these are given."""
        if self.displacements is None:
            return self.times, self.velocities or ()
        if len(self.times) == 1:
            return self.times, (0.0,)
        slopes = _slopes(self.times, self.displacements)
        times, velocities = [self.times[0]], [slopes[0]]
        for k, (start, end) in enumerate(pairwise(self.times)):
            way, span = self.displacements[k + 1] - self.displacements[k], end - start
            left, right = slopes[k], slopes[k + 1]
            inner = []
            for j in range(1, PIECES):
                s = j / PIECES
                bulge = 6.0 * s * (1.0 - s) * (way / span - 0.5 * (left + right))
                inner.append(left + s * (right - left) + bulge)
            lost = way / span - (sum(inner) + 0.5 * (left + right)) / PIECES  # of straight lines below a parabola
            times += [start + span * j / PIECES for j in range(1, PIECES)] + [end]
            velocities += [v + lost * PIECES / (PIECES - 1) for v in inner] + [right]
        return tuple(times), tuple(velocities)


def _slopes(times: tuple[float, ...], values: tuple[float, ...]) -> list[float]:
    """Slope at each time: 0 at the ends and where the values turn, else the weighted harmonic mean of both sides."""
    found = [0.0] * len(times)
    for k in range(1, len(times) - 1):
        before, after = times[k] - times[k - 1], times[k + 1] - times[k]
        left, right = (values[k] - values[k - 1]) / before, (values[k + 1] - values[k]) / after
        if left * right > 0.0:
            w_left, w_right = before + 2.0 * after, 2.0 * before + after
            found[k] = (w_left + w_right) / (w_left / left + w_right / right)
    return found
