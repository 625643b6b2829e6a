"""Owns the bending of tetrahedra and wedges, whose strain jumps from cell to cell: energy spent and right energy.

Linear tetrahedra bend in steps about the mean of neighbours (Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 24 (1987)
337). Wedges do so in the plane of their triangles; along their axis zeta their displacements are
u = u_0 + H x + zeta B x, which bends each of them by itself, with energies as in `bent_hexahedra`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.tetrahedron import gradients, volumes
from warp_mca.physics.elements.hex8r import stiffness
from warp_mca.watch.bent_cells import COLUMNS, Array, Cells, deviator_square, turned_back

_OWN = [0, 1, 2, 4, 5, 6]  # corners of a wedge among those of the hexahedron as which it is stored


def tetrahedra(u: Array, cells: Cells) -> Array:
    """What `bent_cells` names of cells of `tet4` that are looked at, shape (COLUMNS,)."""
    conn, own = cells.conn, slice(cells.looked_at)
    volume, slope = cast("tuple[Array, Array]", cells.shape)
    _, strain = turned_back(np.eye(3)[:, :, None] + np.einsum("eai,eaj->ije", u[conn], slope))
    nodal = _nodal(np.repeat(strain[:, :, None], 4, axis=2), volume, conn)[..., own]
    volume, strain = volume[own], strain[..., own]
    jump = cells.G * deviator_square(strain - nodal.mean(axis=2))
    theta = np.einsum("iian->an", nodal)  # tet4 has the mean dilatation around its nodes
    jump += 0.5 * cells.K * theta.var(axis=0)
    spent = 0.5 * cells.K * (theta**2).mean(axis=0) + cells.G * deviator_square(strain)
    return _found(volume @ (spent - jump), volume @ spent, volume @ jump)


def slopes_of(cells: Cells) -> tuple[Array, Array]:
    """Volumes [m^3], shape (cell_count,), and gradients [1/m], shape (cell_count, 4, 3), of tetrahedra."""
    return np.abs(volumes(cells.x)), gradients(cells.x)


def _found(right: float, spent: float, bent: float) -> Array:
    found = np.zeros(COLUMNS)
    found[:3] = right, spent, bent
    return found


def _nodal(strain: Array, volume: Array, conn: NDArray[np.int32]) -> Array:
    """Mean strains around the corners of cells, shape as `strain` at these corners, (3, 3, corners, cell_count)."""
    node, corner = np.unique(conn.T, return_inverse=True)
    corner, count = corner.reshape(conn.T.shape), len(node)
    weight = np.bincount(corner.ravel(), np.tile(volume, len(corner)), count)
    parts = (strain * volume).reshape(9, -1)
    mean = np.stack([np.bincount(corner.ravel(), part, count) for part in parts]) / weight
    return mean[:, corner].reshape(strain.shape)


@dataclass(frozen=True)
class Wedges:
    """Wedges as they were; cells are the last axis.

    Attributes:
        X: positions of their six corners [m], shape (6, 3, cell_count), float64.
        inverse: of two edges of the mean triangle and half the axis, in columns [1/m], shape (3, 3, cell_count),
            float64.
        normal: of the triangle [-], shape (3, cell_count), float64.
        half: half the length of the axis [m], shape (cell_count,), float64.
        moment: mean of x x over the triangle, about its centre [m^2], shape (3, 3, cell_count), float64.
        volume: [m^3], shape (cell_count,), float64.
        stiffness: of `hex8r` in their stored corners [N/m], shape (cell_count, 24, 24), float64; None with `hex8`.
    """

    X: Array
    inverse: NDArray[np.floating]
    normal: Array
    half: Array
    moment: Array
    volume: Array
    stiffness: Array | None = None


def wedges_of(cells: Cells) -> Wedges:
    """What displacements do not change of wedges."""
    X = np.ascontiguousarray(cells.x[:, _OWN].transpose(1, 2, 0))
    T = _edges(X)
    normal = np.cross(T[:, 0], T[:, 1], axis=0)
    normal /= np.linalg.norm(normal, axis=0)
    corner = 0.5 * (X[:3] + X[3:])
    corner = corner - corner.mean(axis=0)
    corner -= normal * (corner * normal).sum(axis=1, keepdims=True)
    matrix = T.transpose(2, 0, 1)
    moment = np.einsum("ain,ajn->ijn", corner, corner) / 12.0
    inverse, volume = np.linalg.inv(matrix).transpose(1, 2, 0), np.abs(np.linalg.det(matrix))
    return Wedges(X, inverse, normal, np.linalg.norm(T[:, 2], axis=0), moment, volume)


def one_point_wedges_of(cells: Cells) -> Wedges:
    """The same with the stiffness of `hex8r`."""
    moduli = np.full((2, len(cells.conn)), [[cells.K], [cells.G]])
    return replace(wedges_of(cells), stiffness=stiffness(cells.x, *moduli))


def _edges(x: Array) -> Array:
    """Two edges of the mean triangle and half the axis in columns, shape (3, 3, cell_count)."""
    mean = 0.5 * (x[:3] + x[3:])
    return np.stack([mean[1] - mean[0], mean[2] - mean[0], 0.5 * (x[3:] - x[:3]).mean(axis=0)], axis=1)


def _wedge_strains(u: Array, cells: Cells) -> tuple[Array, Array, Array, Array]:
    """Rotation R, mean strain and gradient B of wedges, shape (3, 3, cell_count) all, and what B x is at the corners.

    The last are displacements r of the triangles' corners [m], shape (3 corners, 3, cell_count), times zeta.
    """
    w = cast(Wedges, cells.shape)
    x = w.X + u[cells.conn[:, _OWN]].transpose(1, 2, 0)
    R, strain = turned_back(np.einsum("ikn,kjn->ijn", _edges(x), w.inverse))
    stretch = strain + np.eye(3)[:, :, None]
    r = 0.5 * np.einsum("jin,ajn->ain", R, x[3:] - x[:3])
    r -= 0.5 * np.einsum("ijn,ajn->ain", stretch, w.X[3:] - w.X[:3])
    r -= r.mean(axis=0)
    B = np.einsum("kin,kjn->ijn", np.stack([r[1] - r[0], r[2] - r[0]]), w.inverse[:2])
    return R, strain, B, r


def wedges(u: Array, cells: Cells, element: str) -> Array:
    """What `bent_cells` names of wedges of `hex8`, `hex8r` or `wedge6` that are looked at, shape (COLUMNS,)."""
    w, own = cast(Wedges, cells.shape), slice(cells.looked_at)
    R, strain, B, r = _wedge_strains(u, cells)
    flat = np.eye(3)[:, :, None] - np.einsum("in,jn->ijn", w.normal, w.normal)
    along = np.einsum("in,ijn,jkn->kn", w.normal, B, flat)  # slope of what goes along the axis
    A = np.einsum("ijn,jkn,kln->iln", flat, B, flat)
    S = 0.5 * (A + A.transpose(1, 0, 2))
    theta = np.einsum("iin->n", strain)
    mean = w.volume * (0.5 * cells.K * theta**2 + cells.G * deviator_square(strain))
    tilt = np.einsum("in,ijn,jn->n", along, w.moment, along) / w.half**2
    bent, free, driven = _wedge_bending(S, w, flat, cells)
    jump = _wedge_jumps(strain, S, r, w, cells, flat if element == "wedge6" else None)
    right = mean + w.volume * 0.5 * cells.E * tilt - jump
    if element == "wedge6":  # each bends right by itself
        right, bent = right + driven, 0.0 * driven
        spent = right + jump
    elif element == "hex8r":
        spent = _one_point_energy(u, R, w, cells)
        right, bent = right + driven, driven
    else:
        skew = _shear(A, w) - _shear(S, w)
        spent = mean + bent + cells.G * (skew + w.volume * (2.0 / 3.0 * tilt + (along**2).sum(axis=0) / 6.0))
        share = bent / np.maximum(spent, 1e-300)
        right += share * free + (1.0 - share) * driven
    return _found(right[own].sum(), spent[own].sum(), (bent + jump)[own].sum())


def _shear(A: Array, w: Wedges) -> Array:
    """Energy over G of the shear A x / half that bending of a wedge brings [m^3], shape (cell_count,)."""
    return w.volume * 0.5 / w.half**2 * np.einsum("ijn,jkn,ikn->n", A, w.moment, A)


def _wedge_bending(S: Array, w: Wedges, flat: Array, cells: Cells) -> tuple[Array, Array, Array]:
    """Energies of bending by strains zeta S in the triangle's plane [J]: as `bent_hexahedra` has them."""
    G, E, nu, V = cells.G, cells.E, cells.nu, w.volume
    trace, square = np.einsum("iin->n", S), (S**2).sum(axis=(0, 1))
    bent = G * (V * deviator_square(S) / 3.0 + _shear(S, w))
    force = np.einsum("ijn,jkn->ikn", S, w.moment) / w.half**2
    force = V * G * (2.0 / 3.0 * (S - trace / 3.0 * flat) + 0.5 * (force + force.transpose(1, 0, 2)))
    driven = V / 6.0 * E / (1.0 - nu**2) * (nu * trace**2 + (1.0 - nu) * square)
    against = (1.0 + nu) * (force**2).sum(axis=(0, 1)) - nu * np.einsum("iin->n", force) ** 2
    free = bent**2 * V * E / np.maximum(1.5 * against, 1e-300)
    return bent, free, driven


def _wedge_jumps(strain: Array, S: Array, r: Array, w: Wedges, cells: Cells, flat: Array | None) -> Array:
    """Energy in jumps of strain between wedges [J], shape (cell_count,); in planes `flat` alone, if these are given."""
    ends = np.stack([strain - S, strain + S])[:, :, :, None]
    stretched = np.einsum("in,jn,kn,akn->ijan", w.normal, w.normal, w.normal, r) / w.half
    corner = (ends + stretched).transpose(1, 2, 0, 3, 4).reshape(3, 3, 6, -1)
    conn = cells.conn[:, _OWN]
    left = (corner - _nodal(corner, w.volume, conn)).reshape(3, 3, 2, 3, -1).mean(axis=3)
    if flat is not None:
        left = np.einsum("ijn,jkan,kln->ilan", flat, left, flat)
    theta = np.einsum("iin->n", strain)
    around = np.einsum("iian->an", _nodal(np.repeat(strain[:, :, None], 6, axis=2), w.volume, conn)).mean(axis=0)
    return w.volume * (cells.G * deviator_square(left).mean(axis=0) + 0.5 * cells.K * (theta - around) ** 2)


def _one_point_energy(u: Array, R: Array, w: Wedges, cells: Cells) -> Array:
    """Energy of `hex8r` in displacements without the rotation R [J], shape (cell_count,)."""
    assert w.stiffness is not None
    X = cells.x
    shape = X + u[cells.conn]
    turned = np.einsum("jin,naj->nai", R, shape - shape[:, :1]) - (X - X[:, :1])
    flat = turned.reshape(len(X), 24)
    return 0.5 * np.einsum("ni,nij,nj->n", flat, w.stiffness, flat, optimize=True)
