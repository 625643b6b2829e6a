"""Owns the bending of single hexahedra: energy that their elements spend on it, and that of one that bends right.

Displacements u_i = p xi_i xi_k along edge i bend a brick of half edges h: they ask for strains e_i xi_k, e_i = p/h_i,
and bring a shear (h_i/h_k) e_i xi_i that bending does not have. Strains that vary along edge k, with i, j the others:

    exact (plane stress)   W = V/6 E/(1 - nu^2) (e_i^2 + e_j^2 + 2 nu e_i e_j)
    hex8                   W = V/6 G (4/3 (e_i^2 + e_j^2 - e_i e_j) + (h_i/h_k)^2 e_i^2 + (h_j/h_k)^2 e_j^2)

The mean dilatation leaves the deviator's energy to `hex8`, with 1/(2 (1 + nu)) of the stiffness; the shear adds to it
what cells longer than deep lock by (Hughes, The Finite Element Method (1987), section 4.4). The others have the exact
energy in bricks; cells whose sides lean across the wall lock in all of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.hexahedron import CORNERS
from warp_mca.watch.bent_cells import Array, Cells, deviator_square, turned_back

# What positions of the corners have of the three edges, and of bending in each pair of them, shape (6, 8).
_SHAPES = np.stack([*CORNERS.T, *(CORNERS[:, (m + 1) % 3] * CORNERS[:, (m + 2) % 3] for m in range(3))]) / 8.0
_NONE = np.zeros(0)
_LITTLE = 1e-300  # against division by zero
LEAST = 0.01  # of the energy of bending that sides change as they lean
DEEP = 1.4  # of the strain at yield: from there on, the moment of hex8i is a tenth above that of the section
_ALIGNED = np.sqrt(0.75)  # cosine between the deviators of stretching and of bending in hex8


@dataclass(frozen=True)
class Bricks:
    """Hexahedra as they were, each a parallelepiped but for its modes of bending.

    Cells are the last axis, so that numpy goes through them without a stop: three times as fast as with matrices there.

    Attributes:
        X: positions of their nodes [m], shape (8, cell_count, 3), float64.
        inverse: of the halves of their edges in columns [1/m], shape (3, 3, cell_count), float64.
        edge: unit vectors along the edges, in columns [-], shape (3, 3, cell_count), float64.
        half: halves of the edges [m], shape (3, cell_count), float64.
        mode: what bending in the pair of axes other than m has of X [m], shape (3, 3, cell_count), float64.
        volume: [m^3], shape (cell_count,), float64.
    """

    X: Array
    inverse: NDArray[np.floating]
    edge: NDArray[np.floating]
    half: Array
    mode: Array
    volume: Array

    @cached_property
    def leaning(self) -> list[tuple[int, int, int, Array]]:
        """Axes m, i, k, and how far sides across edge i lean along it over half of edge k [m], shape (cell_count,)."""
        found = []
        for m in range(3):
            for i, k in (((m + 1) % 3, (m + 2) % 3), ((m + 2) % 3, (m + 1) % 3)):
                found.append((m, i, k, np.einsum("an,an->n", self.mode[m], self.edge[:, i])))
        return found


def bricks_of(cells: Cells) -> Bricks:
    """What displacements do not change of hexahedra."""
    X = np.ascontiguousarray(cells.x.transpose(1, 0, 2))
    shapes = _shapes(X)
    T = shapes[:3].transpose(2, 1, 0)  # columns: halves of the edges
    half, volume = np.linalg.norm(T, axis=1).T, 8.0 * np.abs(np.linalg.det(T))
    inverse, edge = (np.ascontiguousarray(A.transpose(1, 2, 0)) for A in (np.linalg.inv(T), T / half.T[:, None]))
    return Bricks(X, inverse, edge, np.ascontiguousarray(half), shapes[3:], volume)


def _shapes(x: Array) -> Array:
    """What positions x of corners, shape (8, cell_count, 3), have of _SHAPES, shape (6, 3, cell_count)."""
    found = (_SHAPES @ x.reshape(8, -1)).reshape(6, -1, 3)
    return np.ascontiguousarray(found.transpose(0, 2, 1))


def _strains(u: Array, cells: Cells) -> tuple[Bricks, Array, Array]:
    """The cells, their mean strain, shape (3, 3, count), and the amplitudes p_mi of bending [m], shape (3, 3, count).

    p_mi goes along edge i with the product of the two natural coordinates other than m.
    """
    bricks = cast(Bricks, cells.shape)
    shapes = _shapes(bricks.X + u[cells.conn.T])
    R, strain = turned_back(np.einsum("kin,kjn->ijn", shapes[:3], bricks.inverse))
    p = np.einsum("ijn,min->mjn", R, shapes[3:]) - bricks.mode
    p -= np.einsum("ijn,mjn->min", strain, bricks.mode)  # what linear displacements have of it
    return bricks, strain, np.einsum("mjn,jan->man", p, bricks.edge)


def _common(strain: Array, p: Array, bricks: Bricks, K: float, G: float) -> Array:
    """Energy of mean strain and of twist [J], shape (cell_count,), which both elements have right."""
    theta = np.einsum("iin->n", strain)
    density = 0.5 * K * theta**2 + G * deviator_square(strain)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        density += G / 6.0 * (p[j, j] / bricks.half[i] + p[i, i] / bricks.half[j]) ** 2
    return bricks.volume * density


def _wasted(strain: Array, p: Array, bricks: Bricks, E: float, projected: bool = True) -> Array:
    """Energy that cells spend beyond what is right where their sides lean as they bend [J], shape (cell_count,).

    A side that leans by c_i xi_i xi_k along edge i turns by p xi_i / h_k, which asks for a strain -p c_i / h_k^2 along
    edge k: its neighbours lean the other way and do not allow it to vanish. With gradients of hourglass modes that are
    `projected`, cells that stretch in turn by p c_i / (3 h_i^2) bend by less than their sides turn.
    """
    found, h = np.zeros_like(bricks.volume), bricks.half
    along = [np.einsum("an,abn,bn->n", bricks.edge[:, k], strain, bricks.edge[:, k]) for k in range(3)]
    for m, i, k, lean in bricks.leaning:
        across = along[k]
        more = projected * (lean / h[i]) ** 2 / 3.0
        found -= (1.0 + more) * p[m, i] * (lean / h[k] ** 2 * across + more / 3.0 * p[m, i] / h[i] ** 2)
    return 0.5 * E * bricks.volume * found


def lean(cells: Cells) -> bool:
    """Whether sides of some cells lean enough to change their energy of bending by `LEAST`."""
    bricks = cast(Bricks, cells.shape)
    h = bricks.half
    return any(
        max((3.0 * (side * h[i] / h[k] ** 2) ** 2).max(), ((side / h[i]) ** 2 / 3.0).max()) > LEAST
        for _, i, k, side in bricks.leaning
    )


def full_hexahedra(u: Array, cells: Cells) -> Array:
    """What `bent_cells` names of cells of `hex8` that are looked at, shape (COLUMNS,)."""
    bricks, strain, p = _strains(u, cells)
    G, V = cells.G, bricks.volume
    common, modes = _common(strain, p, bricks, cells.K, G), _modes(p, bricks, G)
    bent = V / 6.0 * _spent(modes)
    spent = common + bent
    right = common + V / 6.0 * _right(modes, G, cells.nu, bent / np.maximum(spent, _LITTLE))
    right -= _wasted(strain, p, bricks, cells.E, projected=False)
    flowing, flow = _NONE, _NONE
    if cells.sigma_y > 0.0:
        mean, point = np.sqrt(2.0 / 3.0 * deviator_square(strain)), np.sqrt(2.0 / 3.0 * bent / (G * V))
        if 3.0 * G * (mean + 3.0 * point).max() > cells.sigma_y:  # right strains at the surface are no larger
            share, sheared = point**2 / np.maximum(mean**2 + point**2, _LITTLE), _sheared(modes, bricks) / 9.0
            outer = np.sqrt(_right(modes, G, 0.5, share) / (3.0 * G))  # flow keeps volumes
            flows = 3.0 * G * (mean + np.maximum(point, outer)) > cells.sigma_y
            flowing = V * np.where(flows, _flowing(mean, point**2, sheared), 0.0)
            flow = V * np.where(flows, _flow(mean, outer), 0.0)
    return cells.summed(right, spent, bent, flowing, flow)


def walls(u: Array, cells: Cells) -> Array:
    """What `bent_cells` names of cells of `hex8w` and `hex8w3` that are looked at, shape (COLUMNS,)."""
    return cells.summed(*_found(*_strains(u, cells), cells))


def _found(bricks: Bricks, strain: Array, p: Array, cells: Cells) -> list[Array]:
    """Right, spent and bending energy of cells that bend right where their sides do not lean [J]."""
    bent = bricks.volume / 6.0 * _driven(_modes(p, bricks, cells.G), cells.G, cells.nu)
    wasted = _wasted(strain, p, bricks, cells.E)
    spent = _common(strain, p, bricks, cells.K, cells.G) + bent
    return [spent - wasted, spent, bent + wasted]


def one_point_hexahedra(u: Array, cells: Cells) -> Array:
    """What `bent_cells` names of cells of `hex8r` that are looked at, shape (COLUMNS,).

    Stress of bending relaxes as the one point flows: outer/mean of the yield stress is left at the surface.
    """
    bricks, strain, p = _strains(u, cells)
    found, V = _found(bricks, strain, p, cells), bricks.volume
    if cells.sigma_y > 0.0:
        modes = _modes(p, bricks, cells.G)
        bent = V / 6.0 * _driven(modes, cells.G, cells.nu)
        mean, outer = _equivalent(strain, modes, cells.G)
        flows = 3.0 * cells.G * mean > cells.sigma_y
        flowing = mean + outer**2 / np.maximum(3.0 * mean, _LITTLE)
        found += [V * np.where(flows, flowing, 0.0), V * np.where(flows, _flow(mean, outer), 0.0)]
        surface = 3.0 * cells.G * mean + np.sqrt(6.0 * cells.E * bent / V)
        found.append(np.where(flows, 0.0, bent * np.clip(surface / cells.sigma_y - 1.0, 0.0, 1.0)))
    return cells.summed(*found)


def enriched_hexahedra(u: Array, cells: Cells) -> Array:
    """What `bent_cells` names of cells of `hex8i` that are looked at, shape (COLUMNS,): their points, at 0.577 of the
    depth, yield later than their surface."""
    bricks, strain, p = _strains(u, cells)
    found, V = _found(bricks, strain, p, cells), bricks.volume
    if cells.sigma_y > 0.0:
        mean, outer = _equivalent(strain, _modes(p, bricks, cells.G), cells.G)
        flows = 3.0 * cells.G * (mean + outer) > DEEP * cells.sigma_y
        flowing = np.maximum(mean, outer / np.sqrt(3.0))
        found += [V * np.where(flows, flowing, 0.0), V * np.where(flows, _flow(mean, outer), 0.0)]
    return cells.summed(*found)


# Of cells of several scenes these give a row for each.
JOINED = {full_hexahedra, walls, one_point_hexahedra, enriched_hexahedra}


def _equivalent(strain: Array, modes: Modes, G: float) -> tuple[Array, Array]:
    """Equivalent strains [-]: the mean one, and that of right bending at the surface where flow keeps volumes."""
    return np.sqrt(2.0 / 3.0 * deviator_square(strain)), np.sqrt(_driven(modes, G, 0.5) / (3.0 * G))


Modes = list[tuple[Array, Array, Array, Array]]  # e_i, e_j and the forces f_i, f_j of hex8 against them, by edge k


def _modes(p: Array, bricks: Bricks, G: float) -> Modes:
    """Strains of bending [-], and forces of hex8 against them over a third of the volume [Pa]."""
    found, h = [], bricks.half
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        e_i, e_j = p[j, i] / h[i], p[i, j] / h[j]
        f_i = G * ((4.0 / 3.0 + (h[i] / h[k]) ** 2) * e_i - 2.0 / 3.0 * e_j)
        f_j = G * ((4.0 / 3.0 + (h[j] / h[k]) ** 2) * e_j - 2.0 / 3.0 * e_i)
        found.append((e_i, e_j, f_i, f_j))
    return found


def _spent(modes: Modes) -> Array:
    """Energy of bending of hex8 over V/6 [Pa]."""
    return sum((f_i * e_i + f_j * e_j for e_i, e_j, f_i, f_j in modes), np.zeros_like(modes[0][0]))


def _sheared(modes: Modes, bricks: Bricks) -> Array:
    """Energy of the shear that bending brings in hex8, over G V/6 [-]."""
    found, h = np.zeros_like(modes[0][0]), bricks.half
    for k, (e_i, e_j, _, _) in enumerate(modes):
        i, j = (k + 1) % 3, (k + 2) % 3
        found += (h[i] / h[k] * e_i) ** 2 + (h[j] / h[k] * e_j) ** 2
    return found


def _driven(modes: Modes, G: float, nu: float) -> Array:
    """Right energy of bending with the strains of hex8, over V/6 [Pa]."""
    found = sum((e_i**2 + e_j**2 + 2.0 * nu * e_i * e_j for e_i, e_j, _, _ in modes), np.zeros_like(modes[0][0]))
    return 2.0 * G / (1.0 - nu) * found


def _free(modes: Modes, G: float, nu: float) -> Array:
    """Right energy of bending that is free to choose its strain across, over V/6 [Pa].

    Where hex8 bends freely across, its force f_j does no work on e_j or goes against it; the right e_j is the one that
    springs of stiffness -f_j/e_j leave, which stand for what lies around. Otherwise the right strains do the same work.
    """
    plane, E = 2.0 * G / (1.0 - nu), 2.0 * G * (1.0 + nu)
    found = np.zeros_like(modes[0][0])
    for e_i, e_j, f_i, f_j in modes:
        work_i, work_j, across = f_i * e_i, f_j * e_j, nu * plane * e_i * e_j
        left_i = np.where(work_i < 0.0, -across / (plane * e_i - f_i), e_i)
        left_j = np.where(work_j < 0.0, -across / (plane * e_j - f_j), e_j)
        sprung = plane * (left_i**2 + left_j**2 + 2.0 * nu * left_i * left_j)
        worked = (work_i + work_j) ** 2 * E / np.maximum(f_i**2 + f_j**2 - 2.0 * nu * f_i * f_j, _LITTLE)
        found += np.where(np.minimum(work_i, work_j) < 0.0, sprung, worked)
    return found


def _right(modes: Modes, G: float, nu: float, share: Array) -> Array:
    """Right energy of bending over V/6 [Pa]: free where it has most of a cell's energy, else driven by the body."""
    return share * _free(modes, G, nu) + (1.0 - share) * _driven(modes, G, nu)


def _flowing(mean: Array, bent: Array, sheared: Array) -> Array:
    """Mean equivalent strain of the two layers of points: mean strain and bending as they stand to each other there.

    Args:
        mean: equivalent mean strain [-].
        bent: square of that of bending at the points, with its shear, which no mean strain is aligned with [-].
        sheared: square of that of the shear [-].
    """
    square, mixed = mean**2 + bent, 2.0 * _ALIGNED * mean * np.sqrt(np.maximum(bent - sheared, 0.0))
    return 0.5 * (np.sqrt(square + mixed) + np.sqrt(square - mixed))


def _flow(mean: Array, outer: Array) -> Array:
    """Mean over the depth of |mean + outer zeta|, zeta from -1 to 1."""
    return np.where(outer > mean, (mean**2 + outer**2) / np.maximum(2.0 * outer, _LITTLE), mean)
