"""Owns what a model says of its time step: the stable one, mass scaling, several rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array


@dataclass(frozen=True)
class StableStep:
    """Largest stable step of the model.

    Attributes:
        dt: 2 / omega_max [s].
        element: the element that sets it.
        contact_share: share of omega_max^2 that contact springs add there [-].
        shortened: how many times shorter than the step of half of the elements it is, contact springs aside [-].
        damped: how many times shorter than without the stiffness part of the damping of bodies it is [-].
    """

    dt: float
    element: int
    contact_share: float
    shortened: float
    damped: float = 1.0


@dataclass(frozen=True, kw_only=True)
class MassScaling:
    """What mass scaling did to a model.

    Attributes:
        added: mass that has inertia but no weight, part of `Model.mass` [kg], shape (node_count,), float64.
        elements: number of elements that gained mass.
        plain_dt: stable step without [s].
    """

    added: Array
    elements: int
    plain_dt: float


@dataclass(frozen=True, kw_only=True)
class Rates:
    """Levels of a model's nodes and elements; a step of the solver is 2^top substeps.

    Attributes:
        top: highest level.
        common: level of all contacts, joints, driven nodes, bases and torques, and of the nodes that they touch.
        node_level: of each node, shape (node_count,), uint8.
        elements: number of elements on each level, `top` + 1 of them.
    """

    top: int
    common: int
    node_level: NDArray[np.uint8]
    elements: tuple[int, ...]

    @property
    def substeps(self) -> int:
        """Steps of level 0 in a step of the solver."""
        return 1 << self.top

    @property
    def common_steps(self) -> int:
        """Steps of contacts and joints in a step of the solver."""
        return 1 << (self.top - self.common)

    @property
    def work(self) -> int:
        """Elements computed in a step of the solver."""
        return sum(count << (self.top - level) for level, count in enumerate(self.elements))
