"""Owns the arrays of loads: on nodes, in the hinges of chains, and of bases that move."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.joining import AS_IS, SCENE, joinable, of


@joinable
@dataclass(frozen=True, kw_only=True)
class HingeLoad:
    """Torque and friction in a hinge about z; the laws are those of `rigid.loads.Loads`.

    Attributes:
        inner, outer: free nodes near the hinge on which the torque acts, of the body before it (empty for the ground)
            and of the link that it carries, shape (count,), int32.
        friction: Coulomb torque tau_C [N m].
        damping: viscous coefficient c [N m s/rad].
        friction_rate: w_0 [rad/s].
        times: of the drive's torque, from the start of the phase [s], shape (count,), float64.
        torques: of the drive then, towards greater theta of the outer link [N m], shape (count,), float64.
        scene: number of the scene in a batch.
    """

    inner: Index = field(metadata=of("nodes"))
    outer: Index = field(metadata=of("nodes"))
    friction: float = field(metadata=AS_IS)
    damping: float = field(metadata=AS_IS)
    friction_rate: float = field(metadata=AS_IS)
    times: Array = field(metadata=AS_IS)
    torques: Array = field(metadata=AS_IS)
    scene: int = field(default=0, metadata=SCENE)


@joinable
@dataclass(frozen=True, kw_only=True)
class MovableBase:
    """A ground hinge that moves by a table, slides along a direction, or both.

    Attributes:
        start, end: its nodes are those of the pairs [start, end) of `Model.joint_first`.
        coupling: place in `Model.couplings` of its hinge with a pin, -1 without.
        direction: of the slide, a unit vector [-], shape (3,), float64; 0 where it does not slide.
        carriage_mass: [kg].
        times: of the base's motion, from the start of the phase [s], shape (count,), float64.
        velocities: of the base then, x and y [m/s], shape (count, 2), float64.
        scene: number of the scene in a batch.
    """

    start: int = field(metadata=of("pairs"))
    end: int = field(metadata=of("pairs"))
    direction: Array = field(metadata=AS_IS)
    carriage_mass: float = field(metadata=AS_IS)
    times: Array = field(metadata=AS_IS)
    velocities: Array = field(metadata=AS_IS)
    coupling: int = field(default=-1, metadata=of("couplings"))
    scene: int = field(default=0, metadata=SCENE)


@joinable
@dataclass(frozen=True, kw_only=True)
class LoadedNodes:
    """Arrays of one load, to which a kind adds its own, each with a rule of `base/joining.py`.

    Attributes:
        node: on which it acts, shape (count,), int32.
        on_nodes: whether it acts on any at all.
        scene: number of the scene in a batch.
        name: of the load, for columns of the history.
    """

    node: NDArray[np.int32] = field(metadata=of("nodes"))
    scene: int = field(default=0, metadata=SCENE)
    name: str = field(default="", metadata=AS_IS)
    on_nodes: ClassVar[bool] = True

    def impulse(self, duration: float) -> float:
        """Impulse that it gives to a free body until then at most [N s]; 0 where nothing is known of it."""
        return 0.0

    def eigenvalues(self, mass: NDArray[np.float64]) -> NDArray[np.float64]:
        """What it adds at each of its nodes to the eigenvalue that bounds the stable step [1/s^2], shape (count,).

        `mass` is that of all nodes [kg], shape (node_count,).
        """
        return np.zeros(len(self.node))

    def decays(self, mass: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rate of decay of its dashpots at each of its nodes, as part of M^-1 C [1/s], shape (count,).

        They read the velocity of half a step before. `mass` as above.
        """
        return np.zeros(len(self.node))
