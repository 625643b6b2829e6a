"""Owns what an element formulation is: host integrals for mass and stable step, and its stage on the device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.system.block import Block

Array = NDArray[np.float64]


class Element(Protocol):
    """An element formulation: mass, stable step and device stage of the cells of one type.

    Arguments `x` are corners [m], shape (element_count, corners, 3); `K`, `G` moduli [Pa] and `rho` [kg/m^3], shape
    (element_count,); `mass` lumped masses [kg], shape (element_count, corners); all float64.

    Attributes:
        name: in `Body.element` and on the command line.
        cell: name of the cell type that it computes, out of `geometry.cell_types.CELL_TYPES`.
        patches: whether its stage may compute compact patches of elements, so that the model orders them that way.
        leaves: may be left out; types stored as this cell that other elements compute, the default ones of their types.
        one_rate: may be left out; True where forces depend on neighbouring elements too, so that all of a block take
            the same step.
        lags: may be left out; True where all of its hourglass energy is what internal vectors lose as they lag.
        mean_gradients: may be left out where there is no bulk viscosity; x -> mean gradients of the shape functions
            [1/m], shape (element_count, corners, 3). The maker of the force kernel then has a last argument `viscous`.
        oriented: may be left out; as `Hex8w.oriented`, where the order of the corners of cells matters.
    """

    name: str
    cell: str
    patches: bool

    def lumped_masses(self, x: Array, rho: Array) -> Array:
        """Lumped masses [kg], shape (element_count, corners), that keep the mass and the centre of mass exactly."""
        ...

    def eigenvalue_bounds(self, x: Array, K: Array, G: Array, mass: Array, coarse: bool = False) -> Array:
        """Upper bounds on the largest eigenvalue omega^2 [1/s^2], shape (element_count,); `coarse` ones are quicker."""
        ...

    def largest_eigenvalues(self, x: Array, K: Array, G: Array, mass: Array) -> Array:
        """The largest eigenvalue omega^2 itself [1/s^2], or a closer bound, shape (element_count,)."""
        ...

    def stage(self, block: Block, X: Array, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device; `X` are the model's positions [m]."""
        ...


def largest(matrices: Array, coarse: bool = False) -> Array:
    """Largest eigenvalue of symmetric positive matrices, shape (count, n, n); `coarse`: their norm, which bounds it."""
    found = np.linalg.norm(matrices, axis=(1, 2)) if coarse else np.linalg.eigvalsh(matrices)[:, -1]
    return found.astype(np.float64)
