"""Owns point masses: parts of a machine that have mass but no mesh."""

from __future__ import annotations

from dataclasses import dataclass

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bodies import Vec3


@dataclass(frozen=True, kw_only=True)
class PointMass:
    """Mass at a point of a body, or on a node set: a motor, a battery, a screw. It has inertia and weight.

    Attributes:
        body: that carries it.
        mass: [kg].
        at: point in the body's frame [m]: the corners of the cell around it share the mass, with its centre there.
        nodes: node set, in place of `at`, whose nodes share it as they share the mass of the body.
    """

    body: str
    mass: float
    at: Vec3 | None = None
    nodes: str | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("PointMass", body=self.body)
        validate.positive(self.title, mass=self.mass)
        validate.within(self.title, 0.0, 1e12, mass=self.mass)
        if (self.at is None) == (self.nodes is None):
            raise bad_value(f"{self.title}.at", self.at, "give either a point by at=(x, y, z) or a node set by nodes=")
        if self.at is not None:
            validate.vectors(self.title, at=self.at)
        if self.nodes is not None:
            validate.texts(self.title, nodes=self.nodes)

    @property
    def title(self) -> str:
        """How errors name it."""
        return f"PointMass of {self.body}"
