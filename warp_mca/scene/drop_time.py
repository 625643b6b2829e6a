"""Owns how long a drop takes, from what its parts hold against the floor.

What lies below the depth d has the volume V(d) and the section A = dV/dd. Elastic contact holds 0.53 E* sqrt(A) d, as
the theory of Hertz has it for a ball, whose section is 2 pi R d; a column of the height and the volume of the parts
holds E* volume / height^2 d, and yielding 1.5 times yield stress times section. The least of the three takes up the
energy of the fall at a depth D, which v0 reaches after

    D / v0 sqrt(pi) Gamma(1 + 1/n) / Gamma(1/2 + 1/n)

where the work grows as d^n: then sqrt(1 - (d/D)^n) v0 is left. An elastic contact ends after as long again; where it
yields, after a quarter of a period of the mass m on the spring 2 E* sqrt(A / pi), if this is less.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.scene.bodies import Body
from warp_mca.scene.elastic import Elastic
from warp_mca.scene.extent import cell_values, in_place
from warp_mca.scene.struck import shares_below

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh

_BALL = 0.53  # elastic force over E* sqrt(A) d: 4 / (3 sqrt(2 pi)) of a ball, 0.36 of a cone, 1.1 of a flat end [-]
_CONFINED = 1.5  # pressure over yield stress, between 1 of a column and 3 of a ball [-]
_MARGIN = 1.25  # of the time, since shapes differ [-]
_FIRST, _LAST, _DEPTHS = 1e-5, 0.5, 40  # depths over the height of the parts that are looked at, and their number
_STEP = 1.02  # ratio of depths between which the section is taken
_RIGID = 1e20  # E* of rigid bodies, yield stress of what never yields [Pa]
_SPLIT = np.array(((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)))  # hexahedra


class _Tetrahedra(NamedTuple):
    """Tetrahedra that fill bodies above the floor.

    Attributes:
        heights: of their corners above the lowest [m], rising, shape (cell_count, 4), float64.
        values: volume [m^3], yield stress times volume [J], volume over E* [m^3/Pa], shape (cell_count, 3), float64.
    """

    heights: Array
    values: Array


def contact_time(
    bodies: Sequence[Body], meshes: Sequence[Mesh], mass: float, speed: float, floor: Elastic | None
) -> float:
    """Time for which a drop is in contact with the floor z = 0, estimated, 0 of masses without cells [s].

    Args:
        bodies: in their places, with their `meshes`.
        mass, speed: of all [kg], at the impact [m/s].
        floor: its material, None for a rigid one.
    """
    cells = _tetrahedra(bodies, meshes, floor)
    if not len(cells.heights):
        return 0.0
    top, energy = float(cells.heights.max()), 0.5 * mass * speed**2
    done, before, exponent = 0.0, (0.0, 0.0), 1.0
    depth, spring = 0.0, 0.0
    column = float(cells.values[:, 0].sum()) / top**2
    for depth in np.geomspace(_FIRST * top, _LAST * top, _DEPTHS):
        force, spring = _resistance(cells, depth, column)
        power = math.log(max(force, 1e-300) / before[1]) / math.log(depth / before[0]) if before[1] else 0.0
        start, held = before
        # of a force that grows as a power of the depth between the two
        work = (force * depth - held * start) / (power + 1.0) if power > -0.99 else force * (depth - start)
        exponent = max(power + 1.0, 0.5)
        if done + work >= energy:
            depth = start + (depth - start) * (energy - done) / work
            break
        done, before = done + work, (float(depth), force)
    load = depth / speed * math.sqrt(math.pi) * math.gamma(1.0 + 1.0 / exponent) / math.gamma(0.5 + 1.0 / exponent)
    back = 0.5 * math.pi * math.sqrt(mass / spring) if spring else load
    return _MARGIN * (load + min(back, load))


def _resistance(cells: _Tetrahedra, depth: float, column: float) -> tuple[float, float]:
    """Force that holds the parts at this depth [N], and how stiffly it lets go where they yield [N/m], else 0.

    `column` is their volume over the square of their height [m].
    """
    low, middle, high = (_below(cells, depth * ratio) for ratio in (1.0 / _STEP, 1.0, _STEP))
    section, yielding, _ = (high - low) / (depth * (_STEP - 1.0 / _STEP))
    if middle[0] <= 0.0 or section <= 0.0:
        return 0.0, 0.0
    modulus = middle[0] / middle[2]
    elastic = modulus * min(_BALL * math.sqrt(section), column) * depth
    if elastic <= _CONFINED * yielding:
        return float(elastic), 0.0
    return float(_CONFINED * yielding), float(2.0 * modulus * math.sqrt(section / math.pi))


def _below(cells: _Tetrahedra, depth: float) -> Array:
    """What of the tetrahedra's values lies below a depth, shape (3,), float64."""
    near = cells.heights[:, 0] < depth
    return shares_below(cells.heights[near], depth) @ cells.values[near]


def _tetrahedra(bodies: Sequence[Body], meshes: Sequence[Mesh], floor: Elastic | None) -> _Tetrahedra:
    """The cells of all bodies that have some, by tetrahedra; other cells than hexahedra have their corners first."""
    heights, values = [np.zeros((0, 4))], [np.zeros((0, 3))]
    below = (1.0 - floor.nu**2) / floor.E if floor else 0.0
    for body, mesh in zip(bodies, meshes, strict=True):
        points = in_place(body, mesh)
        corners = [mesh.hexahedra[:, _SPLIT].reshape(-1, 4)]
        corners += [cells[:, :4] for name, cells in mesh.cells.items() if name != "hexahedron"]
        cell = np.concatenate(
            [np.repeat(np.arange(len(mesh.hexahedra)), len(_SPLIT)), np.arange(len(mesh.hexahedra), mesh.cell_count)]
        )
        at = points[np.concatenate(corners)]
        volume = np.abs(np.linalg.det(at[:, 1:] - at[:, :1])) / 6.0
        if body.rigid:
            soft, strength = np.full(len(cell), 1.0 / _RIGID), np.full(len(cell), _RIGID)
        else:
            E, nu, strength = (cell_values(body, mesh, name)[cell] for name in ("E", "nu", "yield_stress"))
            soft, strength = (1.0 - nu**2) / E, np.where(np.isfinite(strength), strength, _RIGID)
        own = np.stack([volume, volume * strength, volume * (soft + below)], axis=1)
        kept = np.isfinite(own).all(axis=1) & (volume > 0.0)
        heights.append(np.sort(at[:, :, 2], axis=1)[kept])
        values.append(own[kept])
    found = np.concatenate(heights)
    return _Tetrahedra(found - found.min(initial=math.inf), np.concatenate(values))
