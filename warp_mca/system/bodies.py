"""Owns `Bodies`: the meshes of a scene as one, with what joints, contacts and loads read of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.geometry.mesh import Mesh
from warp_mca.scene import Point, Scene
from warp_mca.scene.materials import Material

GROUND = -1  # stands for the ground, or for no node
NEAR = 0.05  # distance from a body at which a point may lie, as a share of the body's extent


class Bodies:
    """Concatenated meshes of a scene; `model.assembly.Assembly` makes them.

    Attributes:
        X: positions [m], shape (node_count, 3), float64.
        shape: positions before ties and bonds moved nodes onto faces [m], shape (node_count, 3), float64.
        node_start, element_start: first node and element of each body, by name.
        rigid: whether each element belongs to a rigid body, and is not computed, shape (element_count,), bool.
        materials: those of the scene; `material` is each element's index among them.
        K, G: moduli [Pa] of each element; rho: its density [kg/m^3], see `cells.densities`; volume: of its mesh [m^3].
        face_depth, face_height: of the type of each element, as in `CellType` [-], shape (element_count,).
        mass: lumped masses [kg], shape (node_count,), float64.
    """

    materials: list[Material]
    material: Index
    K: Array
    G: Array
    rho: Array
    volume: Array
    face_depth: Array
    face_height: Array
    mass: Array

    def __init__(
        self,
        scene: Scene,
        meshes: Mapping[str, Mesh],
        X: Mapping[str, Array],
        shape: Mapping[str, Array] | None = None,
    ) -> None:
        self.scene, self.meshes = scene, meshes
        self.node_start: dict[str, int] = {}
        self.element_start: dict[str, int] = {}
        nodes = elements = 0
        for body in scene.bodies:
            self.node_start[body.name], self.element_start[body.name] = nodes, elements
            nodes += len(meshes[body.name].points)
            elements += meshes[body.name].cell_count
        self.element_count = elements
        self.X: Array = np.concatenate([X[body.name] for body in scene.bodies])
        self.shape = self.X if shape is None else np.concatenate([shape[body.name] for body in scene.bodies])
        count = [meshes[body.name].cell_count for body in scene.bodies]
        self.rigid: NDArray[np.bool_] = np.repeat([body.rigid for body in scene.bodies], count)

    def where(self, node: int) -> str:
        """Body and place of a node, for errors."""
        body = max((start, name) for name, start in self.node_start.items() if start <= node)[1]
        x, y, z = self.X[node]
        return f"{body} at ({x:.4g}, {y:.4g}, {z:.4g}) m"

    def nodes(self, body: str, name: str) -> Index:
        """Nodes of a set of a body's mesh."""
        return self.meshes[body].nodes(name) + self.node_start[body]

    def all_nodes(self, body: str) -> slice:
        """All nodes of a body."""
        first = self.node_start[body]
        return slice(first, first + len(self.meshes[body].points))

    def nearest(self, point: Point | None) -> int:
        """Node nearest to a point, or GROUND.

        Raises:
            RequestError: the point lies off the box around its body, by more than NEAR of its extent.
        """
        if point is None:
            return GROUND
        nodes, at = self.meshes[point.body].points, np.asarray(point.at)
        lower, upper = nodes.min(axis=0), nodes.max(axis=0)
        apart = float(np.linalg.norm(at - np.clip(at, lower, upper)))
        if apart > NEAR * float(np.linalg.norm(upper - lower)):
            remedy = f"that is {apart:.3g} m off the body; give a point of it in its own frame"
            raise bad_value(f"Point of {point.body}.at", point.at, remedy)
        offsets = nodes - at
        return int(np.argmin((offsets**2).sum(axis=1))) + self.node_start[point.body]
