"""Owns what a run of pure finite elements begins with: the scene at its release, and where the run is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.base.validate import is_list
from warp_mca.phases.every import METHOD
from warp_mca.rigid.handoff import HandOff
from warp_mca.scene import RigidPlane, Scene

Array = NDArray[np.float64]


@dataclass
class Place:
    """Where a run is.

    Attributes:
        phase: "swing", or "impact" with the scene's output interval.
        swung: steps until that phase.
        touch: row of the impact whose interval the touch is in; None while nothing has touched.
        joint_impulse: of each joint in the swing [N s], by name.
        configuration: times [s] and greatest distances of the links' nodes from those of rigid links, as shares of the
            chain's reach [-].
        wall: wall-clock seconds of the run so far, by stage, and those of swing and impact.
    """

    phase: Literal["swing", "impact"] = "swing"
    swung: int = 0
    touch: int | None = None
    joint_impulse: dict[str, list[float]] = field(default_factory=dict)
    configuration: list[list[float]] = field(default_factory=list)
    wall: dict[str, float] = field(default_factory=dict)

    @staticmethod
    def of(stored: Mapping[str, Any]) -> Place:
        """The place that a file holds.

        Raises:
            TypeError, ValueError: a value is missing, or of another type or range.
        """
        place = Place(**stored)
        counts = [place.swung, *([] if place.touch is None else [place.touch])]
        rows = [*place.joint_impulse.values(), *place.configuration, list(place.wall.values())]
        if place.phase not in ("swing", "impact") or not all(type(count) is int and count >= 0 for count in counts):
            raise ValueError(stored)
        if not all(isinstance(row, list) and is_list(row) for row in rows):
            raise ValueError(stored)
        return place


def check(scene: Scene) -> None:
    """Refuse scenes that cannot be run from their release by finite elements alone.

    Raises:
        RequestError: so it is.
    """
    if scene.rigid is None:
        remedy = "without a rigid phase bodies start where they are, by finite elements; leave it out"
        raise bad_value("method", METHOD, remedy)
    if scene.t_end is not None:
        raise bad_value("Scene.t_end", scene.t_end, f"{METHOD} ends duration after the first touch; leave t_end out")
    if scene.prescribed:
        remedy = f"times of a Prescribed velocity count from the touch, which {METHOD} does not know; leave it out"
        raise bad_value("Scene.prescribed", scene.prescribed[0].body, remedy)


def is_of_link(scene: Scene, contact: int, links: list[str]) -> bool:
    """Whether a contact is of a link with something that is none."""
    item = scene.contacts[contact]
    other = None if isinstance(item.master, RigidPlane) else item.master.body
    return (item.slave.body in links) != (other in links)


def angles_of(touch: HandOff) -> Callable[[float], Array]:
    """Coordinates of rigid links as a function of time [s], by cubic interpolation of the swing with its rates."""
    from scipy.interpolate import CubicHermiteSpline

    assert touch.swing is not None
    return CubicHermiteSpline(touch.swing.t, touch.swing.theta_t, touch.swing.theta_dot_t)
