"""Owns the cells of a body whose bending is looked at, and the rotation that is taken off their displacements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array

TURNS = 8  # of the iteration at most: rotations are exact to rounding for stretches from 0.1 to 10

# What a look finds of the cells of a body, in this order; sums over cells.
RIGHT = 0  # strain energy of cells that bend right, in the shape that these have [J]
SPENT = 1  # strain energy of the cells as their element has it [J]
BENT = 2  # the part of it that single cells spend on bending, or on jumps of strain between them [J]
FLOWING = 3  # equivalent strain at the points of cells that yield, times volume [m^3]
FLOW = 4  # the same of cells that bend right [m^3]
MISSED = 5  # energy of bending stresses beyond the yield stress in cells that do not yield [J]
FOLDED = 6  # cells of rubber that are inside out at a corner, the most that a look saw [-]
COLUMNS = 7

_CYCLE = [0, 1, 2, 0, 1]  # rows and columns of a matrix, with those that come after the last ones


@dataclass(frozen=True)
class Cells:
    """Cells of one body, material and type that are looked at.

    Attributes:
        body: number of the body, in the order of `Model.element_start`.
        energies: that finds what `RIGHT` and the following name, of displacements and this, shape (COLUMNS,), or
            (scene_count, COLUMNS) with `ends`.
        conn: their nodes, shape (cell_count, corner_count), int32; where strains of neighbours count, those next to
            them follow.
        looked_at: how many of `conn` are looked at.
        K, G: bulk and shear modulus [Pa].
        sigma_y: yield stress [Pa], 0 where the material stays elastic.
        share: cells of the body, material and type over those looked at [-].
        X: positions of all nodes [m], shape (node_count, 3), float64.
        prepare: that finds what displacements do not change of them.
        ends: how many of `conn` are those of each scene and the ones before it, where scenes are looked at together.
    """

    body: int
    energies: Callable[[Array, Cells], Array]
    conn: NDArray[np.int32]
    looked_at: int
    K: float
    G: float
    sigma_y: float
    share: float
    X: Array
    prepare: Callable[[Cells], object]
    ends: tuple[int, ...] = ()

    def summed(self, *columns: Array) -> Array:
        """Sums of values of cells, each shape (cell_count,) or empty for 0, filled up to the shape of `energies`."""
        first, found = 0, np.zeros((max(1, len(self.ends)), COLUMNS))
        for row, end in zip(found, self.ends or (len(self.conn),), strict=True):
            row[: len(columns)] = [value[first:end].sum() for value in columns]
            first = end
        return found if self.ends else found[0]

    @property
    def E(self) -> float:
        """Young's modulus [Pa]."""
        return 9.0 * self.K * self.G / (3.0 * self.K + self.G)

    @property
    def nu(self) -> float:
        """Poisson's ratio [-]."""
        return (3.0 * self.K - 2.0 * self.G) / (6.0 * self.K + 2.0 * self.G)

    @cached_property
    def shape(self) -> object:
        """What `prepare` finds; at the first look, while a GPU computes steps."""
        return self.prepare(self)

    @property
    def x(self) -> Array:
        """Positions of their nodes [m], shape (cell_count, corner_count, 3)."""
        return self.X[self.conn]


def turned_back(F: Array) -> tuple[Array, Array]:
    """Rotation R of each gradient F of the motion and the strain of R^T F, shape (3, 3, count) all."""
    R = F
    for _ in range(TURNS):  # Newton's iteration of the polar decomposition: Higham, SIAM J. Sci. Stat. Comput. 7 (1986)
        cofactor = _cofactors(R)
        closer = 0.5 * (R + cofactor / np.einsum("jn,jn->n", R[0], cofactor[0]))
        change, R = np.abs(closer - R).max(initial=0.0), closer
        if change < 1e-8:  # the next one would change it by the square of that
            break
    stretch = np.einsum("kin,kjn->ijn", R, F)
    return R, 0.5 * (stretch + stretch.transpose(1, 0, 2)) - np.eye(3)[:, :, None]


def _cofactors(A: Array) -> Array:
    """Of each matrix, shape (3, 3, count)."""
    B = A[_CYCLE][:, _CYCLE]
    return B[1:4, 1:4] * B[2:, 2:] - B[1:4, 2:] * B[2:, 1:4]


def deviator_square(strain: Array) -> Array:
    """dev(strain) : dev(strain) of tensors, shape (3, 3, count)."""
    return np.einsum("ij...,ij...->...", strain, strain) - np.einsum("ii...->...", strain) ** 2 / 3.0
