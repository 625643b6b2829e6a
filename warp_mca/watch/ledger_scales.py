"""Owns what energy balances of a model are measured by: how fast it turns, and the rounding of its positions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warp_mca.model.model import Model


def spin(model: Model) -> float:
    """Greatest angular speed of a body at the start, from the velocities of its nodes about their mean [rad/s]."""
    greatest = 0.0
    first = sorted(model.node_start.values())
    for begin, end in zip(first, [*first[1:], model.node_count], strict=True):
        share = model.mass[begin:end, None] / model.mass[begin:end].sum()
        with np.errstate(over="ignore", invalid="ignore"):
            arm, velocity = (x - (share * x).sum(axis=0) for x in (model.X[begin:end], model.V[begin:end]))
            rate = np.sqrt((share * velocity**2).sum() / (share * arm**2).sum())
        greatest = max(greatest, float(rate)) if np.isfinite(rate) else greatest
    return greatest


def rounding(model: Model, dt: float) -> float:
    """Energy of all bodies that move by four times the rounding of positions in a step [J]: no balance is finer."""
    speed = 4.0 * float(np.spacing(np.abs(model.X).max())) / dt
    return 0.5 * float(model.mass.sum()) * speed * speed
