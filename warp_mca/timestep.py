"""Owns the stable time step: the largest eigenvalue of any element, contact springs counted in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.element import eigenvalue_bounds, largest_eigenvalues

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StableStep:
    """Largest stable step of the model.

    Attributes:
        dt: 2 / omega_max [s].
        element: the element that sets it.
        contact_share: share of omega_max^2 that contact springs add there [-].
    """

    dt: float
    element: int
    contact_share: float


def stable_step(x: Array, K: Array, G: Array, mass: Array, contact: Array) -> StableStep:
    """Stable step from max over elements of (element eigenvalue + contact eigenvalue), both upper bounds of their part.

    The largest eigenvalue of an assembly never exceeds the largest of its elements (Irons and Treharne, 1971). A
    closed-form bound ranks the elements; the exact eigenvalue is then found for those that could still be the worst.

    Args:
        x: corners [m], shape (element_count, 8, 3). K, G: moduli [Pa], shape (element_count,).
        mass: lumped masses [kg], shape (element_count, 8).
        contact: eigenvalue that contact springs add at each element [1/s^2], shape (element_count,).
    """
    bound = eigenvalue_bounds(x, K, G, mass) + contact
    order = np.argsort(-bound)
    worst, element = 0.0, int(order[0])
    batch = 256
    for start in range(0, len(order), batch):
        part = order[start : start + batch]
        if bound[part[0]] <= worst:
            break
        exact = largest_eigenvalues(x[part], K[part], G[part], mass[part]) + contact[part]
        best = int(np.argmax(exact))
        if exact[best] > worst:
            worst, element = float(exact[best]), int(part[best])
    return StableStep(dt=2.0 / np.sqrt(worst), element=element, contact_share=float(contact[element] / worst))
