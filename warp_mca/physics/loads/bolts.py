"""Owns bolts on the host: nine springs between two triangles that move with their ends, which are a beam together.

Three springs of k_v join the corners of equal triangles, six of k_d each corner with the two others. With the distance
L between the triangles, their radius r, and s^2 = 3 r^2 / (L^2 + 3 r^2), c^2 = 1 - s^2, both ends have the stiffness

    axial      k_a = 3 k_v + 6 k_d c^2             = E A / L
    bending    k_b = r^2 / 2 (3 k_v + 3/2 k_d c^2) = E I / L
    shear      k_s = 3 k_d s^2                     = 1 / (L^3 / (12 E I) + L / (kappa G A)),

those of a Timoshenko beam about its middle (Przemieniecki, Theory of Matrix Structural Analysis, 1968, section 5.6;
kappa of a circle by Cowper, J. Appl. Mech. 33 (1966) 335). Solved for r, k_d and k_v, none of which is negative:

    r^2 = (2 k_b + k_s L^2 / 2) / k_a,   3 k_d s^2 = k_s,   3 k_v = k_a - 2 k_s L^2 / (3 r^2).

Springs between means of nodes keep momentum and angular momentum, however far the parts turn.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.joining import AS_IS, ITEMS, joinable
from warp_mca.base.rotation import rotation_matrix
from warp_mca.physics.loads.bolts_stage import BoltsStage as Stage
from warp_mca.physics.loads.springs import WHOLE, SpringNodes, lightness, signed
from warp_mca.scene.bodies import Vec3
from warp_mca.scene.bolts import Bolt
from warp_mca.system.bodies import Bodies
from warp_mca.system.loads import LoadedNodes

__all__ = ["BoltNodes", "Stage", "build"]

RISE = 2.0  # times in which a wave runs along the shank and its seat while the preload grows [-]
FLAT = 0.05  # of the spread of an end's nodes: directions in which they spread less do not carry its corners [-]
ALIKE = 1e-6  # by which cells may be farther from an end than the nearest one and hold it, too [-]
End = tuple[Index, Array]  # nodes, and the weight of each in each corner [-], shape (3, count), float64


@joinable
@dataclass(frozen=True, kw_only=True)
class BoltNodes(LoadedNodes):
    """A bolt; `node` are those of its springs in turn.

    Attributes:
        bars: its springs.
        slanted: 1 of slanted ones, else 0 [-], shape (9,), int32.
        rise: time in which its preload grows [s].
    """

    bars: tuple[SpringNodes, ...] = field(metadata=ITEMS)
    slanted: Index = field(metadata=AS_IS)
    rise: float = field(metadata=AS_IS)

    def eigenvalues(self, mass: Array) -> Array:
        """Those of its springs."""
        return np.concatenate([bar.added for bar in self.bars])


@dataclass(frozen=True)
class Truss:
    """Springs that are a beam, see above.

    Attributes:
        radius: r [m].
        straight, slanted: k_v, k_d [N/m].
        axial: k_a [N/m].
    """

    radius: float
    straight: float
    slanted: float
    axial: float


def truss(bolt: Bolt, L: float) -> Truss:
    """The springs of a bolt of length L [m]."""
    A, G = bolt.area, 0.5 * bolt.E / (1.0 + bolt.nu)
    EI, kappa = bolt.E * A * bolt.diameter**2 / 16.0, 6.0 * (1.0 + bolt.nu) / (7.0 + 6.0 * bolt.nu)
    k_a, k_b, k_s = bolt.E * A / L, EI / L, 1.0 / (L**3 / (12.0 * EI) + L / (kappa * G * A))
    square = (2.0 * k_b + 0.5 * k_s * L**2) / k_a
    return Truss(
        radius=float(np.sqrt(square)),
        straight=max(k_a - 2.0 * k_s * L**2 / (3.0 * square), 0.0) / 3.0,
        slanted=k_s * (L**2 + 3.0 * square) / (9.0 * square),
        axial=k_a,
    )


def build(load: Bolt, assembly: Bodies) -> BoltNodes:
    """The arrays of a bolt.

    Raises:
        RequestError: its ends lie in one place, or too few nodes hold one.
    """
    places = [_place(assembly, body, at) for body, at in ((load.body, load.at), (load.other, load.other_at))]
    L = float(np.linalg.norm(places[1] - places[0]))
    if load.diameter * 1e-3 > L:
        remedy = "its ends lie in one place; give the middle of its thread or nut, at the other end of the shank"
        raise bad_value(f"{load.title}.other_at", load.other_at, remedy)
    own, axis = truss(load, L), (places[1] - places[0]) / L
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first /= np.linalg.norm(first)
    angles = 2.0 * np.pi * np.arange(3) / 3.0
    ring = own.radius * (np.outer(np.cos(angles), first) + np.outer(np.sin(angles), np.cross(axis, first)))
    ends = [
        _end(assembly, load, key, body, place, ring)
        for key, body, place in zip(("at", "other_at"), (load.body, load.other), places, strict=True)
    ]
    bars = tuple(_bar(assembly, load, own, ends, i, j) for i in range(3) for j in range(3))
    node = np.concatenate([bar.node for bar in bars])
    slanted = 1 - np.eye(3, dtype=np.int32).ravel()
    rise = RISE * (L + _reach(load)) / _speed(assembly, load)
    return BoltNodes(node=node, name=load.name, bars=bars, slanted=slanted, rise=rise)


def _place(assembly: Bodies, body: str, at: Vec3) -> Array:
    """Where a point of a body's frame is at the start [m], shape (3,)."""
    R = rotation_matrix(assembly.scene.body(body).rotation)
    return assembly.X[assembly.node_start[body]] + R @ (np.array(at) - assembly.meshes[body].points[0])


def _end(assembly: Bodies, load: Bolt, key: str, body: str, place: Array, ring: Array) -> End:
    """The nodes that hold an end, and their weights in the corners of its triangle.

    A corner x is the mean sum w X that follows each affine motion of the nodes, with w of least sum w^2 / m: for
    S = sum m (X - C) (X - C)^T about their centre C, w = m (1 / M + (X - C) . S^-1 (x - C)).
    """
    part = np.arange(len(assembly.mass), dtype=np.int32)[assembly.all_nodes(body)]
    reach = _reach(load)
    if not assembly.scene.body(body).rigid:
        part = part[np.linalg.norm(assembly.X[part] - place, axis=1) <= reach]
        if load.reach is None and not _spans(assembly, part):
            part = _cells_around(assembly, body, place)
    part = part[assembly.mass[part] > 0.0]
    X, mass = assembly.X[part], assembly.mass[part]
    offset = X - mass @ X / mass.sum() if len(part) else X
    if not _spans(assembly, part):
        what = f"{len(part)} nodes of {body} within reach = {reach:g} m of it, where three that span a face are needed"
        remedy = "put it into the body, or give a greater reach or finer cells there"
        raise bad_value(f"{load.title}.{key}", getattr(load, key), f"{what}; {remedy}")
    inverse = np.linalg.pinv(np.einsum("n,ni,nj->ij", mass, offset, offset), rcond=FLAT**2, hermitian=True)
    corner = place + ring - mass @ X / mass.sum()
    return part, mass * (1.0 / mass.sum() + corner @ inverse @ offset.T)


def _spans(assembly: Bodies, part: Index) -> bool:
    """Whether nodes span a face."""
    part = part[assembly.mass[part] > 0.0]
    if len(part) < 3:
        return False
    X, mass = assembly.X[part], assembly.mass[part]
    spread = np.linalg.svd(X - mass @ X / mass.sum(), compute_uv=False)
    return bool(spread[1] > FLAT * spread[0])


def _cells_around(assembly: Bodies, body: str, place: Array) -> Index:
    """Nodes of the cells of a body whose middles are nearest to a place that lies in the ball around their nodes.

    They are several where it lies on a node or edge of cells alike, so that the end stays in their middle.
    """
    start, best, found = assembly.node_start[body], np.inf, np.zeros(0, np.int32)
    for cells in assembly.meshes[body].cells.values():
        if not len(cells):
            continue
        corner = assembly.X[cells + start]
        middle = corner.mean(axis=1)
        away = np.linalg.norm(middle - place, axis=1)
        k = int(away.argmin())
        if away[k] < best and away[k] <= np.linalg.norm(corner[k] - middle[k], axis=1).max():
            best, alike = float(away[k]), away <= (1.0 + ALIKE) * away[k]
            found = np.unique(cells[alike] + start).astype(np.int32)
    return found


def _bar(assembly: Bodies, load: Bolt, own: Truss, ends: list[End], i: int, j: int) -> SpringNodes:
    """The spring from corner i of the first end to corner j of the second one."""
    bodies, held = (load.body, load.other), [(own, share[k]) for (own, share), k in zip(ends, (i, j), strict=True)]
    node, weight = signed(held)
    between = weight @ assembly.X[node]
    length = float(np.linalg.norm(between))
    k, pull = (own.straight, load.preload / 3.0) if i == j else (own.slanted, 0.0)
    light, added = 0.0, []
    for body, end in zip(bodies, held, strict=True):
        light += lightness(assembly, body, *end, between / length)
    for body, (nodes, _) in zip(bodies, held, strict=True):
        added.append(np.full(len(nodes), (WHOLE if assembly.scene.body(body).rigid else 1.0) * k * light))
    # the preload stores F^2 / (2 k_a) in all of them
    rest = -0.5 * load.preload / own.axial
    return SpringNodes(
        node=node,
        weight=weight,
        added=np.concatenate(added),
        decay=np.zeros(len(node)),
        lightness=light,
        between=between,
        direction=np.zeros(3),
        length=length,
        preload=pull,
        rest=rest,
        lowest=0.0,
        table=np.array([[0.0, 1.0], [0.0, k]]),
        damper=np.zeros((2, 0)),
    )


def _reach(load: Bolt) -> float:
    return load.diameter if load.reach is None else load.reach


def _speed(assembly: Bodies, load: Bolt) -> float:
    """Least speed of pressure waves in its bodies [m/s]; of rigid ones that in a shank of steel."""
    found = [np.sqrt(load.E / 7850.0)]
    for body in load.bodies().values():
        first = assembly.element_start[body]
        own = slice(first, first + assembly.meshes[body].cell_count)
        if not assembly.scene.body(body).rigid:
            found.append(np.sqrt((assembly.K[own] + 4.0 / 3.0 * assembly.G[own]) / assembly.rho[own]).min())
    return float(min(found))
