"""Owns the assembly of a scene's meshes into flat arrays: elements by formulation, materials, masses, blocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.chunks import CHUNK, chunks
from warp_mca.base.errors import bad_value
from warp_mca.elements import ELEMENTS, Element, default_element
from warp_mca.geometry.cell_types import CELL_TYPES
from warp_mca.geometry.mesh import Mesh
from warp_mca.model.patches import PATCH, compact_order
from warp_mca.model.stable_step import StableStep, at_elements, element_steps, stable_step
from warp_mca.model.surfaces import Faces, make_faces
from warp_mca.scene import Body, Point, Scene, Surface
from warp_mca.scene.materials import Material

Array = NDArray[np.float64]
Index = NDArray[np.int32]

GROUND = -1  # stands for the ground, or for no node
NEAR = 0.05  # distance from a body at which a point may lie, as a share of the body's extent


@dataclass(frozen=True, kw_only=True)
class Block:
    """Elements that run the same kernels.

    Attributes:
        element: name of their formulation.
        law: module of the law by which they flow, as `Elastic.law`; empty where they keep no plastic history.
        finite: whether strains may be large.
        conn: nodes of each element, shape (corners, element_count), int32.
        material: row of `Model.law`, shape (element_count,), int32.
        first: index of the first element in the model.
        ends: where the elements of each scene of a batch end in the block; empty for one scene.
        level_ends: where the elements of each level of `Model.rates` end in the block; empty with one rate.
    """

    element: str
    law: str
    finite: bool
    conn: Index
    material: Index
    first: int
    ends: tuple[int, ...] = ()
    level_ends: tuple[int, ...] = ()

    @property
    def plastic(self) -> bool:
        """Whether they keep a plastic history."""
        return bool(self.law)

    @property
    def kind(self) -> tuple[bool, str, str, bool]:
        """Key of the block: (not plastic, law, element, finite). Blocks of a model are sorted by it."""
        return not self.plastic, self.law, self.element, self.finite


def body_materials(body: Body, mesh: Mesh) -> list[tuple[Material, Index]]:
    """Materials of a body with the cells that each fills; together they fill the body.

    Raises:
        RequestError: a named cell set is unknown, or cells are left without material or have two.
    """
    if isinstance(body.material, Material):
        return [(body.material, np.arange(mesh.cell_count, dtype=np.int32))]
    owner = np.full(mesh.cell_count, -1, dtype=np.int32)
    listed = list(body.material.items())
    for k, (name, _) in enumerate(listed):
        if name == "*":
            continue
        if name not in mesh.cell_sets:
            known = ", ".join(sorted(mesh.cell_sets)) or "none"
            raise bad_value(f"Body {body.name}.material", name, f"the mesh's cell sets are {known}; or use '*'")
        others = owner[mesh.cell_sets[name]]
        if (others >= 0).any():
            remedy = f"some of its cells are in {listed[others.max()][0]} too; give each cell one material"
            raise bad_value(f"Body {body.name}.material", name, remedy)
        owner[mesh.cell_sets[name]] = k
    if "*" in body.material:
        owner[owner < 0] = [name for name, _ in listed].index("*")
    if (owner < 0).any():
        raise bad_value(f"Body {body.name}.material", [n for n, _ in listed], "some cells have none; add a '*' entry")
    return [(m, np.flatnonzero(owner == k).astype(np.int32)) for k, (_, m) in enumerate(listed)]


@dataclass(frozen=True)
class Cells:
    """Cells of one formulation and strain measure.

    Attributes:
        element: the formulation.
        finite: whether strains may be large.
        conn: nodes of each cell, shape (cell_count, corners), int32.
        index: of each in the concatenated meshes, shape (cell_count,), int32.
    """

    element: Element
    finite: bool
    conn: Index
    index: Index


def body_cells(body: Body, mesh: Mesh) -> list[Cells]:
    """The cells of a body by formulation, in the mesh's own numbering.

    Raises:
        RequestError: the mesh holds cells that should have been cut to those of the body's element.
    """
    finite, own = body.kinematics == "finite", ELEMENTS[body.element]
    found, first = [], 0
    for name, conn in mesh.cells.items():
        if len(conn):
            if name in CELL_TYPES[own.cell].cut_from:
                remedy = f"its mesh holds {CELL_TYPES[name].field}; pass meshes through warp_mca.mesh"
                raise bad_value(f"Body {body.name}.element", body.element, remedy)
            index = np.arange(first, first + len(conn), dtype=np.int32)
            found.append(Cells(own if name == own.cell else default_element(name), finite, conn, index))
            first += len(conn)
    return found


def _masses(cells: Cells, points: Array, rho: Array) -> Array:
    """Lumped masses of cells [kg], shape (cell_count, corners); `rho` [kg/m^3] is that of every element."""
    mass = np.empty(cells.conn.shape)
    for part in chunks(len(mass), CHUNK):
        mass[part] = cells.element.lumped_masses(points[cells.conn[part]], rho[cells.index[part]])
    return mass


def _sum_to_nodes(conn: Index, value: Array, node_count: int) -> Array:
    """Sum of what each element gives its corners, shape (node_count,), float64."""
    return np.bincount(conn.ravel(), value.ravel(), minlength=node_count).astype(np.float64)


def nodal_masses(scene: Scene, meshes: Mapping[str, Mesh]) -> dict[str, Array]:
    """Lumped nodal masses [kg] of each body, shape (node_count,), float64: what carries the momentum."""
    masses = {}
    for body in scene.bodies:
        mesh = meshes[body.name]
        rho = np.empty(mesh.cell_count)
        for material, cells in body_materials(body, mesh):
            rho[cells] = material.rho
        total = np.zeros(len(mesh.points))
        for part in body_cells(body, mesh):
            total += _sum_to_nodes(part.conn, _masses(part, mesh.points, rho), len(total))
        masses[body.name] = total
    return masses


class Assembly:
    """Concatenated meshes of a scene on the way to a Model.

    Attributes:
        X: positions [m], shape (node_count, 3).
        cells: the elements by formulation and strain measure.
        materials: those of the scene; `material` is each element's index among them.
        K, G: moduli [Pa], and volume [m^3], of each element.
        mass: lumped masses [kg], shape (node_count,).
    """

    def __init__(self, scene: Scene, meshes: Mapping[str, Mesh], X: Mapping[str, Array]) -> None:
        self.scene, self.meshes = scene, meshes
        self.node_start: dict[str, int] = {}
        self.element_start: dict[str, int] = {}
        nodes = elements = 0
        for body in scene.bodies:
            self.node_start[body.name], self.element_start[body.name] = nodes, elements
            nodes += len(meshes[body.name].points)
            elements += meshes[body.name].cell_count
        self.element_count = elements
        self.X = np.concatenate([X[body.name] for body in scene.bodies])
        self.cells = self._merged_cells()
        self.materials: list[Material] = []
        self.material = np.empty(elements, dtype=np.int32)
        for body in scene.bodies:
            for material, cells in body_materials(body, meshes[body.name]):
                if material not in self.materials:
                    self.materials.append(material)
                self.material[cells + self.element_start[body.name]] = self.materials.index(material)
        self.K = np.array([m.bulk_modulus for m in self.materials])[self.material]
        self.G = np.array([m.shear_modulus for m in self.materials])[self.material]
        rho = np.array([m.rho for m in self.materials])[self.material]
        self.volume = np.empty(elements)
        self.mass = np.zeros(nodes)
        self.element_mass = []
        for part in self.cells:
            mass = _masses(part, self.X, rho)
            self.volume[part.index] = mass.sum(axis=1) / rho[part.index]
            self.element_mass.append(mass)
            self.mass += _sum_to_nodes(part.conn, mass, nodes)

    def _merged_cells(self) -> list[Cells]:
        found: dict[tuple[str, bool], list[Cells]] = {}
        for body in self.scene.bodies:
            first, start = self.node_start[body.name], self.element_start[body.name]
            for part in body_cells(body, self.meshes[body.name]):
                moved = Cells(part.element, part.finite, part.conn + first, part.index + start)
                found.setdefault((part.element.name, part.finite), []).append(moved)
        return [
            Cells(
                parts[0].element,
                parts[0].finite,
                np.concatenate([part.conn for part in parts]),
                np.concatenate([part.index for part in parts]),
            )
            for _, parts in sorted(found.items())
        ]

    def law(self) -> Array:
        """Parameters of each material, followed by zeros up to the length of the longest."""
        rows = [m.parameters for m in self.materials]
        width = max(map(len, rows))
        return np.array([(*row, *[0.0] * (width - len(row))) for row in rows])

    def blocks(self) -> tuple[tuple[Block, ...], Index]:
        """Elements grouped by kernels, those of a patch together, and the order that this gives them."""
        blocks, order, first = [], [], 0
        for law in sorted({m.law for m in self.materials}, key=lambda law: (not law, law)):
            flowing = np.array([m.law == law for m in self.materials])[self.material]
            for part in self.cells:
                mine = np.flatnonzero(flowing[part.index])
                if len(mine):
                    if part.element.patches:
                        mine = mine[compact_order(self.X, part.conn[mine], PATCH)]
                    index = part.index[mine]
                    blocks.append(
                        Block(
                            element=part.element.name,
                            law=law,
                            finite=part.finite,
                            conn=np.ascontiguousarray(part.conn[mine].T),
                            material=self.material[index],
                            first=first,
                        )
                    )
                    order.append(index)
                    first += len(index)
        return tuple(blocks), np.concatenate(order)

    def stable(self, added: Array) -> StableStep:
        """Stable step with what contact springs add to the eigenvalue at each node [1/s^2]."""
        steps = []
        for part, mass in zip(self.cells, self.element_mass, strict=True):
            moduli = self.K[part.index], self.G[part.index]
            contact = at_elements(part.conn, added)
            steps.append(stable_step(part.element, self.X, part.conn, *moduli, mass, contact, part.index))
        return min(steps, key=lambda step: step.dt)

    def element_steps(self, added: Array, *, coarse: bool = False) -> Array:
        """Stable step of each element by itself [s], as `stable_step.element_steps`, in the order of the meshes."""
        steps = np.empty(self.element_count)
        for part, mass in zip(self.cells, self.element_mass, strict=True):
            moduli = self.K[part.index], self.G[part.index]
            contact = at_elements(part.conn, added)
            steps[part.index] = element_steps(part.element, self.X, part.conn, *moduli, mass, contact, coarse=coarse)
        return steps

    def nodes(self, body: str, name: str) -> Index:
        """Nodes of a set of a body's mesh."""
        return self.meshes[body].nodes(name) + self.node_start[body]

    def faces(self, surface: Surface) -> Faces:
        """Boundary faces of a surface."""
        node, element = self.meshes[surface.body].surface(surface.nodes)
        node = (node + self.node_start[surface.body]).astype(np.int32)
        element = (element + self.element_start[surface.body]).astype(np.int32)
        return make_faces(self.X, node, element, self.K, self.G, self.volume)

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
