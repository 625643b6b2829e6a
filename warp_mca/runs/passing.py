"""Owns what a run says of bodies that went into each other, or through a plane, where no contact keeps them out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.boxes import cell_boxes
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.point_location import LOCATE
from warp_mca.model.model import Model
from warp_mca.model.surfaces import face_geometry
from warp_mca.scene import RigidPlane, Scene

Array = NDArray[np.float64]
Index = NDArray[np.int32]

INSIDE = 1e-6  # distance from a cell at which a point lies in it, over the width of a face
SAMPLE = 32  # of the nodes of a body that lie deep in the box around another, so many are tried, evenly spread


@dataclass(frozen=True)
class Skin:
    """The surface of a body in the model's numbering.

    Attributes:
        name: of the body.
        own: all of its nodes.
        nodes: of its surface, shape (node_count,), int32.
        faces: their corners, shape (face_count, 4), int32.
        cells: of the body by stored cell type, each shape (cell_count, corner_count), int32.
        width: of a face, median [m].
    """

    name: str
    own: slice
    nodes: Index
    faces: Index
    cells: Mapping[str, Index]
    width: float

    @staticmethod
    def of(name: str, mesh: Mesh, model: Model) -> Skin:
        """That of one body."""
        start = model.node_start[name]
        faces = (mesh.boundary[0] + start).astype(np.int32)
        width = float(np.sqrt(np.median(face_geometry(model.X, faces)[0])))
        cells = {kind: (conn + start).astype(np.int32) for kind, conn in mesh.cells.items() if len(conn)}
        return Skin(name, slice(start, start + len(mesh.points)), np.unique(faces), faces, cells, width)


class Shape:
    """All bodies as they are at one time.

    Attributes:
        x: positions of the nodes [m], shape (node_count, 3), float64.
    """

    def __init__(self, x: Array) -> None:
        self.x = x
        self._boxes: dict[str, tuple[Array, Array]] = {}

    def depth(self, skin: Skin, other: Skin) -> float:
        """How deep nodes of another body lie in one [m], 0 where none is deeper than a face of it is wide."""
        (lower, upper), (least, greatest) = self._box(skin), self._box(other)
        lower, upper = lower + skin.width, upper - skin.width
        if (least > upper).any() or (greatest < lower).any():
            return 0.0
        found = self.x[other.nodes]
        found = found[((found > lower) & (found < upper)).all(axis=1)]
        return self._deepest(skin, found[:: -(-len(found) // SAMPLE)]) if len(found) else 0.0

    def _box(self, skin: Skin) -> tuple[Array, Array]:
        if skin.name not in self._boxes:
            columns = self.x[skin.own].T  # numpy's extremes along the longer axis take many times as long
            least, greatest = (np.array([f(column) for column in columns]) for f in (np.min, np.max))
            self._boxes[skin.name] = least, greatest
        return self._boxes[skin.name]

    def _deepest(self, skin: Skin, at: Array) -> float:
        from scipy.spatial import KDTree

        inside, x = np.zeros(len(at), dtype=bool), self.x
        for kind, cells in skin.cells.items():
            inside |= LOCATE[kind](at, x, cells, cell_boxes(x, cells))[2] < INSIDE * skin.width
        if not inside.any():
            return 0.0
        area, normal = face_geometry(x, skin.faces)
        middle = x[skin.faces].mean(axis=1)
        near = KDTree(middle).query(at[inside])[1]
        depth = np.abs(((at[inside] - middle[near]) * normal[near]).sum(axis=1)) / area[near]
        deepest = float(depth.max())
        return deepest if deepest > skin.width else 0.0


@dataclass(frozen=True)
class BelowPlane:
    """Nodes of a body's surface that no contact keeps above a plane that others of its nodes are in contact with."""

    body: str
    nodes: Index
    plane: RigidPlane
    width: float

    def depth(self, shape: Shape) -> float:
        """How deep the deepest lies below the plane [m], 0 where none is deeper than a face is wide."""
        normal = np.asarray(self.plane.normal, dtype=float)
        height = (shape.x[self.nodes] - self.plane.point) @ normal / np.linalg.norm(normal)
        deepest = -float(height.min(initial=0.0))
        return deepest if deepest > self.width else 0.0

    @property
    def sentence(self) -> str:
        """What a warning says of them, after the depth."""
        return f"nodes of {self.body} that are not in its contact's surface went below the rigid plane, {{:.2g}} m deep"


@dataclass(frozen=True)
class WithinBody:
    """Two bodies that nothing binds to each other."""

    one: Skin
    other: Skin

    def depth(self, shape: Shape) -> float:
        """How deep nodes of one lie in the other [m], 0 where none is deeper than a face of it is wide."""
        return max(shape.depth(self.one, self.other), shape.depth(self.other, self.one))

    @property
    def sentence(self) -> str:
        """What a warning says of them, before the remedy."""
        return f"{self.one.name} and {self.other.name} went into each other, {{:.2g}} m deep"


Pair = BelowPlane | WithinBody


def pairs_of(scene: Scene, meshes: Mapping[str, Mesh], model: Model) -> list[Pair]:
    """What can go into each other of a scene's model and does not lie in each other at its start."""
    skins = {body.name: Skin.of(body.name, meshes[body.name], model) for body in scene.bodies}
    found: list[Pair] = []
    for item in model.passes:
        if isinstance(plane := scene.contacts[item.contact].master, RigidPlane):
            skin = skins[scene.contacts[item.contact].slave.body]
            found.append(BelowPlane(skin.name, np.setdiff1d(skin.nodes, item.slave), plane, skin.width))
    bound = {frozenset((joint.body, joint.other)) for joint in scene.joints}
    bound |= {frozenset((tie.slave.body, tie.master.body)) for tie in scene.ties}
    found += [WithinBody(skins[a], skins[b]) for a, b in combinations(skins, 2) if frozenset((a, b)) not in bound]
    start = Shape(model.X)
    return [pair for pair in found if not pair.depth(start)]


def passed(model: Model, pairs: list[Pair], u: Array, before: Array) -> Array:
    """Greatest depth of each pair [m], shape (pair_count,), of a few looks.

    Args:
        model: of the scene alone.
        pairs: of the scene.
        u: displacements [m], shape (node_count, 3), float64.
        before: what was found before, or empty.
    """
    if not np.isfinite(u).all():
        return before
    shape = Shape(model.X + u)
    found = np.array([pair.depth(shape) for pair in pairs])
    return np.maximum(found, before) if len(before) else found


def passing_warnings(pairs: list[Pair], depths: Array) -> list[str]:
    """A sentence for each pair that went into each other."""
    remedy = "no contact keeps them out there; take all of the surface, such as nodes='boundary', in a Contact"
    return [
        f"{pair.sentence.format(depth)}: {remedy}" for pair, depth in zip(pairs, depths, strict=False) if depth > 0.0
    ]
