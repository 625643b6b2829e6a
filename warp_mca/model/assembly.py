"""Owns the assembly of a scene's meshes into flat arrays: elements by formulation, materials, masses, blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cell_types import CELL_TYPES
from warp_mca.geometry.mesh import Mesh
from warp_mca.kernels.elements.patch_layout import PATCH
from warp_mca.model.stable_step import Elements, at_elements, element_steps, stable_step
from warp_mca.model.viscosity import thermal_strains, viscosities
from warp_mca.physics.elements import Element
from warp_mca.physics.elements.cells import (
    Cells,
    body_cells,
    body_materials,
    densities,
    element_masses,
    kept_mass,
    own_masses,
    point_masses,
    sum_to_nodes,
)
from warp_mca.physics.elements.patches import compact_order
from warp_mca.scene import Scene
from warp_mca.system.block import Block
from warp_mca.system.bodies import Bodies
from warp_mca.system.failing import criterion_of, failing_of
from warp_mca.system.time_step import StableStep

Array = NDArray[np.float64]
Index = NDArray[np.int32]


class Assembly(Bodies):
    """Concatenated meshes of a scene on the way to a Model: its `Bodies`, cut into elements.

    Attributes:
        cells: the elements by formulation and strain measure; `element_mass` are lumped masses of each [kg].
        relief: divisor of each node's mass in eigenvalues [-], shape (node_count,), see `TiedNodes.relief`; None
            where it is 1.
    """

    def __init__(
        self,
        scene: Scene,
        meshes: Mapping[str, Mesh],
        X: Mapping[str, Array],
        shape: Mapping[str, Array] | None = None,
    ) -> None:
        super().__init__(scene, meshes, X, shape)
        nodes, elements = len(self.X), self.element_count
        self.relief: Array | None = None
        self.cells = self._merged_cells()
        self.materials = []
        self.material = np.empty(elements, dtype=np.int32)
        for body in scene.bodies:
            for material, cells in body_materials(body, meshes[body.name]):
                if material not in self.materials:
                    self.materials.append(material)
                self.material[cells + self.element_start[body.name]] = self.materials.index(material)
        self.K = np.array([m.bulk_modulus for m in self.materials])[self.material]
        self.G = np.array([m.shear_modulus for m in self.materials])[self.material]
        self.rho = np.concatenate([densities(body, meshes[body.name]) for body in scene.bodies])
        for body in scene.bodies:
            mesh, own, first = meshes[body.name], self.all_nodes(body.name), self.element_start[body.name]
            rho = self.rho[first : first + mesh.cell_count]
            rho *= kept_mass(body, mesh, self.shape[own], self.X[own], rho)
        self.volume, self.face_depth, self.face_height = np.empty(elements), np.ones(elements), np.ones(elements)
        self.mass = np.zeros(nodes)
        self.element_mass = []
        for part in self.cells:
            mass = element_masses(part, self.X, self.rho)
            self.volume[part.index] = mass.sum(axis=1) / self.rho[part.index]
            kind = CELL_TYPES[part.element.cell]
            self.face_depth[part.index], self.face_height[part.index] = kind.face_depth, kind.face_height
            self.element_mass.append(mass)
            self.mass += sum_to_nodes(part.conn, mass, nodes)
        for body in (body for body in scene.bodies if body.mass is not None):
            own = self.all_nodes(body.name)
            self.mass[own] = own_masses(body, meshes[body.name], self.mass[own])
        for name in {item.body for item in scene.masses}:
            own = self.all_nodes(name)
            self.mass[own] += point_masses(scene, meshes[name], name, self.mass[own])

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

    def blocks(self, rigid: bool = False, first: int = 0) -> tuple[tuple[Block, ...], Index]:
        """Elements grouped by kernels, those of a patch together, and the order that this gives them.

        They are those that are computed, or those of `rigid` bodies; `first` is the number of the first one.
        """
        blocks, order = [], [np.zeros(0, dtype=np.int32)]
        every = [None if rigid else viscosities(self, k) for k in range(len(self.cells))]
        heat = None if rigid else thermal_strains(self)
        laws = sorted({m.law for m in self.materials}, key=lambda law: (not law, law))
        for law, (k, part), failure in product(laws, enumerate(self.cells), self._criteria(rigid)):
            alike = [m.law == law and (rigid or criterion_of(m) == failure) for m in self.materials]
            mine = np.flatnonzero(np.array(alike)[self.material[part.index]] & (self.rigid[part.index] == rigid))
            if not len(mine):
                continue
            if part.element.patches:
                mine = mine[compact_order(self.X, part.conn[mine], PATCH)]
            index, viscosity = part.index[mine], every[k]
            thermal = None if heat is None or (heat[0, index] < 0).all() else heat[:, index]
            viscosity = None if viscosity is None else viscosity[:, mine]
            if thermal is not None and viscosity is None:
                viscosity = np.zeros((2, len(mine)))
            blocks.append(
                Block(
                    element=part.element.name,
                    law=law,
                    finite=part.finite,
                    conn=np.ascontiguousarray(part.conn[mine].T),
                    material=self.material[index],
                    first=first,
                    viscosity=viscosity,
                    thermal=thermal,
                    failing=failing_of(failure, self.materials, self.material[index], self.volume[index]),
                )
            )
            order.append(index)
            first += len(index)
        return tuple(blocks), np.concatenate(order)

    def _criteria(self, rigid: bool) -> list[str]:
        """Modules of the criteria by which elements fail, "" for those that never do; rigid ones do not."""
        return [""] if rigid else sorted({criterion_of(m) for m in self.materials})

    def stable(self, added: Array, body: str | None = None) -> StableStep:
        """Stable step with what contact springs add to the eigenvalue at each node [1/s^2], of all or of one body."""
        return min(map(stable_step, self.computed(added, body)), key=lambda step: step.dt)

    def element_steps(self, added: Array, *, coarse: bool = False) -> Array:
        """Stable step of each element by itself [s], as `stable_step.element_steps`, in the order of the meshes."""
        steps = np.full(self.element_count, np.inf)  # of elements of rigid bodies
        for elements in self.computed(added):
            steps[elements.index] = element_steps(elements, coarse=coarse)
        return steps

    def computed(self, added: Array, body: str | None = None) -> Iterator[Elements]:
        """Elements that are computed, by formulation, with masses less by `relief`; all, or those of one body."""
        added = added if self.relief is None else added * self.relief
        for part, own in zip(self.cells, self.element_mass, strict=True):
            kept = ~self.rigid[part.index]
            if body is not None:
                first = self.element_start[body]
                kept &= (part.index >= first) & (part.index < first + self.meshes[body].cell_count)
            if kept.any():
                some = slice(None) if kept.all() else kept  # without a copy
                conn, index, mass = part.conn[some], part.index[some], own[some]
                mass = mass if self.relief is None else mass / self.relief[conn]
                yield self.elements(part.element, conn, mass, added, index)

    def elements(self, element: Element, conn: Index, mass: Array, added: Array, index: Index) -> Elements:
        """Elements with their moduli, and with what springs add at their nodes."""
        return Elements(element, self.X, conn, self.K[index], self.G[index], mass, at_elements(conn, added), index)
