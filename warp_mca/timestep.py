"""Owns the stable time step: the largest eigenvalue of any element, contact springs counted in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.elements import Element
from warp_mca.elements.hexahedron import CHUNK, chunks

Array = NDArray[np.float64]
Index = NDArray[np.int32]

BATCH = 256  # elements whose exact eigenvalues are found at a time
MOST = 100 * BATCH  # of them: 24 x 24 problems cost 50 us each


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


def stable_step(
    formulation: Element, X: Array, conn: Index, K: Array, G: Array, mass: Array, contact: Array, index: Index
) -> StableStep:
    """Stable step from max over elements of (element eigenvalue + contact eigenvalue), both upper bounds of their part.

    The largest eigenvalue of an assembly never exceeds the largest of its elements (Irons and Treharne, 1971). A
    coarse bound ranks the elements, a closer one those that could still be the worst after the first exact
    eigenvalues, and exact ones decide.

    Args:
        formulation: of the elements.
        X: positions of the nodes [m], shape (node_count, 3), float64.
        conn: nodes of each element, shape (element_count, corners), int32. K, G: moduli [Pa], shape (element_count,).
        mass: lumped masses [kg], shape (element_count, corners).
        contact: eigenvalue that contact springs add at each element [1/s^2], shape (element_count,).
        index: number that each element goes by, shape (element_count,).
    """

    def exact(part: NDArray[np.intp]) -> Array:
        return formulation.largest_eigenvalues(X[conn[part]], K[part], G[part], mass[part]) + contact[part]

    def bounds(part: NDArray[np.intp] | slice, coarse: bool) -> Array:
        return formulation.eigenvalue_bounds(X[conn[part]], K[part], G[part], mass[part], coarse) + contact[part]

    bound = np.empty(len(conn))
    for part in chunks(len(conn), CHUNK):
        bound[part] = bounds(part, True)
    first = _greatest(bound, BATCH)
    value = exact(first)
    worst, element = float(value.max()), int(first[value.argmax()])
    bound[first] = 0.0
    left = np.flatnonzero(bound > worst)
    for part in chunks(len(left), CHUNK):
        bound[left[part]] = bounds(left[part], False)
    left = left[bound[left] > worst]
    left = left[np.argsort(-bound[left], kind="stable")]
    if len(left) > MOST:
        x = X[conn[left]]
        left = left[_different(np.column_stack([bound[left], (x - x[:, :1]).reshape(len(left), -1)]))]
    for start in range(0, len(left), BATCH):
        part = left[start : start + BATCH]
        if bound[part[0]] <= worst:
            break
        if start >= MOST:  # the bound of what is left does as well
            worst, element = float(bound[part[0]]), int(part[0])
            break
        value = exact(part)
        if value.max() > worst:
            worst, element = float(value.max()), int(part[value.argmax()])
    share = float(contact[element] / worst)
    return StableStep(dt=2.0 / np.sqrt(worst), element=int(index[element]), contact_share=share)


def _greatest(value: Array, count: int) -> NDArray[np.intp]:
    """Indices of the `count` greatest values, from the greatest on."""
    least = np.partition(value, len(value) - count)[len(value) - count] if count < len(value) else -np.inf
    found = np.flatnonzero(value >= least)
    return found[np.argsort(-value[found], kind="stable")][:count]


def _different(rows: Array) -> NDArray[np.intp]:
    """First of each lot of rows that agree to a millionth of their columns' largest entries, in order."""
    digits = np.round(rows / np.abs(rows).max(axis=0).clip(np.finfo(float).tiny) * 1e6).astype(np.int32)
    _, kept = np.unique(
        np.ascontiguousarray(digits).view(f"V{digits.itemsize * digits.shape[1]}").ravel(), return_index=True
    )
    return np.sort(kept)
