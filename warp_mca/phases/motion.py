"""Owns where a scene stands between two phases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warp_mca.phases.plastic_history import BlockHistory
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.placement import Placement

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Stress:
    """What recorders show of bodies at rest.

    Attributes:
        stress: xx, yy, zz, xy, yz, xz at all nodes in the world frame [Pa], shape (node_count, 6), float32.
        von_mises: [Pa], shape (node_count,), float32.
        plastic_strain: equivalent plastic strain [-], shape (node_count,), float32.
        rotations: of the bodies by name when it was so [-], each shape (3, 3), float64.
    """

    stress: NDArray[np.float32]
    von_mises: NDArray[np.float32]
    plastic_strain: NDArray[np.float32]
    rotations: Mapping[str, Array]


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Rigid motion of all bodies, and the shape and history that earlier impacts left them.

    Attributes:
        t: time from the release [s].
        chain: rigid links, with hinges where deformation has moved them.
        theta: coordinates of the chain [rad], as `Swing` has them, shape (coordinate_count,), float64.
        theta_dot: their rates, shape (coordinate_count,), float64.
        placements: pose and motion of each body by name.
        shapes: displacement of each node in its body's frame [m], by body, shape (node_count, 3), float64; empty while
            nothing has been deformed.
        history: plastic history of the elements; empty while nothing has yielded.
        elastic, plastic, hourglass: energies that the bodies hold [J].
        rest: what recorders show of the bodies; None where nothing has been deformed, or without recorders.
    """

    t: float
    chain: Chain
    theta: Array
    theta_dot: Array
    placements: Mapping[str, Placement]
    shapes: Mapping[str, Array] = field(default_factory=dict)
    history: tuple[BlockHistory, ...] = ()
    elastic: float = 0.0
    plastic: float = 0.0
    hourglass: float = 0.0
    rest: Stress | None = None

    def points(self, name: str, points: Array) -> Array:
        """Shape of a body in its frame, from its nodes without displacement [m], each shape (node_count, 3)."""
        return points + self.shapes[name] if self.shapes else points

    @property
    def strain_energy(self) -> float:
        """Of the elements, plastic work included [J]."""
        return self.elastic + self.plastic + self.hourglass
