"""Owns joints: what ties nodes of two bodies, or of a body and the ground."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType
from typing import Literal

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bodies import Vec3


@dataclass(frozen=True, kw_only=True)
class Revolute:
    """A hinge ("re-joint"): pairs of coincident nodes on the hinge axis move as one.

    Attributes:
        name: unique in the scene.
        body: first body.
        at: a point of the hinge axis in the frame of `body` [m].
        other: second body, or None for the ground.
        other_at: the same point in the frame of `other` [m].
        axis: direction of the hinge axis in the frame of both bodies [-].
        nodes: "axis" ties every node on the axis, as a pin does; "ends" the two outermost pairs, as the paper does.
    """

    name: str
    body: str
    at: Vec3
    other: str | None = None
    other_at: Vec3 = (0.0, 0.0, 0.0)
    axis: Vec3 = (0.0, 0.0, 1.0)
    nodes: Literal["axis", "ends"] = "axis"

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Revolute", name=self.name, body=self.body)
        validate.kinds(
            f"Revolute {self.name}", (str, NoneType), "name a body, or None for the ground", other=self.other
        )
        validate.vectors(f"Revolute {self.name}", at=self.at, other_at=self.other_at, axis=self.axis)
        if not any(self.axis):
            raise bad_value(f"Revolute {self.name}.axis", self.axis, "give a direction other than zero")
        if self.nodes not in ("axis", "ends"):
            raise bad_value(f"Revolute {self.name}.nodes", self.nodes, "choose axis or ends")
