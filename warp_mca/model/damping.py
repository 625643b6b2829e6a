"""Owns what the damping of bodies leaves of the stable step."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.model.stable_step import with_dashpots
from warp_mca.physics.loads.damping import DampedNodes
from warp_mca.system.loads import LoadedNodes
from warp_mca.system.time_step import StableStep

if TYPE_CHECKING:
    from warp_mca.model.assembly import Assembly

Loads = Mapping[str, Sequence[LoadedNodes]]


def load_decays(loads: Loads, mass: Array) -> Array:
    """Rate of decay that dashpots of loads have at each node [1/s], shape (node_count,), float64."""
    total = np.zeros(len(mass))
    for item in _all(loads):
        np.add.at(total, item.node, item.decays(mass))
    return total


def with_damping(stable: StableStep, parts: Assembly, loads: Loads, added: Array, decay: float) -> StableStep:
    """The stable step where elements of some bodies have stiffness damping and Maxwell branches.

    An element of frequency w is stable with (1 + sum g) w^2 h^2 + 2 (decay + beta w^2) h <= 4, see `with_dashpots`:
    branches are at their stiffest for what is quicker than their times. No assembly asks for less than its elements.

    Args:
        stable: without these, but with dashpots of a rate of `decay` [1/s].
        parts, added: of the scene, as in `Assembly.stable`.
        loads: as in `Model`.
    """
    found = [stable]
    for item in (item for item in _all(loads) if isinstance(item, DampedNodes)):
        if not (item.stiffness or len(item.gain)):
            continue
        own = parts.stable(added, item.body)
        square = (2.0 / own.dt) ** 2
        stiff = replace(own, dt=own.dt / float(np.sqrt(1.0 + item.gain.sum())))
        found.append(with_dashpots(stiff, decay + item.stiffness * square))
    least = min(found, key=lambda step: step.dt)
    return replace(least, damped=stable.dt / least.dt if least.dt > 0.0 else 1.0)


def _all(loads: Loads) -> Iterable[LoadedNodes]:
    return (item for items in loads.values() for item in items)
