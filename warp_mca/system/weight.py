"""Owns the weight of nodes whose inertia mass scaling has raised: gravity acts on the physical mass alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array

if TYPE_CHECKING:
    from warp_mca.system.model import Model


def nodal_gravity(model: Model) -> Array | None:
    """Acceleration of each node by its weight, g m_physical / m [m/s^2], shape (node_count, 3); None where it is g."""
    if model.scaling is None or not model.gravity.any():
        return None
    counts = [model.node_count] if model.batch is None else np.diff(model.batch.nodes)
    share = 1.0 - model.scaling.added / model.mass
    return np.repeat(model.gravity, counts, axis=0) * share[:, None]


def heavy_mass(model: Model) -> Array:
    """Mass of each node that has weight [kg], shape (node_count,), float64."""
    return model.mass if model.scaling is None else model.mass - model.scaling.added
