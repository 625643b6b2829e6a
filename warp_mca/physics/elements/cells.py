"""Owns what a body's mesh is made of: cells by formulation, the materials that fill them, and their lumped masses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.chunks import CHUNK, chunks
from warp_mca.base.errors import bad_value
from warp_mca.geometry.cell_types import CELL_TYPES
from warp_mca.geometry.degenerate import among
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.point_location import around_point, weighted_set
from warp_mca.geometry.shape_volume import of_cells
from warp_mca.physics.elements import ELEMENTS, Element, default_element
from warp_mca.physics.elements.given_mass import given_masses, mesh_with_carriers
from warp_mca.physics.ties.nodes import within_body
from warp_mca.scene import Body, Scene
from warp_mca.scene.materials import Material

Array = NDArray[np.float64]
Index = NDArray[np.int32]


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


def densities(body: Body, mesh: Mesh) -> Array:
    """Density of each cell [kg/m^3], shape (cell_count,), float64: with `Body.exact_mass`, times the volume of the
    shape over that of its cells."""
    rho = np.empty(mesh.cell_count)
    for material, cells in body_materials(body, mesh):
        rho[cells] = material.rho
    return rho * of_cells(mesh) if body.exact_mass else rho


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
                remedy = f"its mesh holds {CELL_TYPES[name].field or name}; pass meshes through warp_mca.mesh"
                raise bad_value(f"Body {body.name}.element", body.element, remedy)
            index = np.arange(first, first + len(conn), dtype=np.int32)
            first += len(conn)
            element = own if name == own.cell else default_element(name)
            others = {own.cell, *getattr(element, "leaves", ())} - {name}
            for kind in sorted(kind for kind in others if CELL_TYPES[kind].stored_as == name):
                mine = among(conn, kind)
                if mine.any():
                    other = own if kind == own.cell else default_element(kind)
                    found.append(Cells(other, finite, conn[mine][:, CELL_TYPES[kind].own_corners], index[mine]))
                    conn, index = conn[~mine], index[~mine]
            if len(conn):
                oriented = getattr(element, "oriented", None)
                conn = oriented(body, mesh, conn, index) if oriented else conn
                found.append(Cells(element, finite, conn, index))
    return found


def element_masses(cells: Cells, points: Array, rho: Array) -> Array:
    """Lumped masses of cells [kg], shape (cell_count, corners); `rho` [kg/m^3] is that of every element."""
    mass = np.empty(cells.conn.shape)
    for part in chunks(len(mass), CHUNK):
        mass[part] = cells.element.lumped_masses(points[cells.conn[part]], rho[cells.index[part]])
    return mass


def sum_to_nodes(conn: Index, value: Array, node_count: int) -> Array:
    """Sum of what each element gives its corners, shape (node_count,), float64."""
    return np.bincount(conn.ravel(), value.ravel(), minlength=node_count).astype(np.float64)


def kept_mass(body: Body, mesh: Mesh, before: Array, after: Array, rho: Array) -> float:
    """Mass of a body over that of its cells once ties and bonds have moved nodes onto faces [-].

    Args:
        body, mesh: of it.
        before, after: places of the nodes [m], shape (node_count, 3), float64.
        rho: density of each cell [kg/m^3], shape (cell_count,), float64.
    """
    if np.array_equal(before, after):
        return 1.0
    parts = body_cells(body, mesh)
    old, new = (sum(element_masses(part, points, rho).sum() for part in parts) for points in (before, after))
    return float(old / new)


def nodal_masses(scene: Scene, meshes: Mapping[str, Mesh]) -> dict[str, Array]:
    """Lumped nodal masses [kg] of each body, shape (node_count,), float64: what carries the momentum.

    Slaves of ties within a body have none: their masters carry it.
    """
    masses = {}
    for body in scene.bodies:
        mesh = meshes[body.name]
        rho = densities(body, mesh)
        points, ties = within_body(scene, meshes, body.name)
        rho *= kept_mass(body, mesh, mesh.points, points, rho)
        total = np.zeros(len(points))
        for part in body_cells(body, mesh):
            total += sum_to_nodes(part.conn, element_masses(part, points, rho), len(total))
        total = own_masses(body, mesh, total)
        masses[body.name] = ties.carried(total + point_masses(scene, mesh, body.name, total))
    return masses


def _volumes(body: Body, mesh: Mesh) -> Array:
    """Volume that each node of a mesh stands for [m^3], shape (node_count,), float64."""
    total = np.zeros(len(mesh.points))
    for part in body_cells(body, mesh):
        volume = element_masses(part, mesh.points, np.ones(mesh.cell_count))
        total += sum_to_nodes(part.conn, volume, len(total))
    return total


def own_masses(body: Body, mesh: Mesh, mass: Array) -> Array:
    """Masses of the nodes of a body [kg], shape (node_count,), float64: `mass` of its cells, unless it has its own."""
    return mass if body.mass is None else given_masses(body, mesh, _volumes(body, mesh))


def with_carriers(body: Body, mesh: Mesh) -> Mesh:
    """The mesh of a body, with nodes that carry its own mass where it has one, see `given_mass`."""
    return mesh if body.mass is None else mesh_with_carriers(body, mesh, _volumes(body, mesh))


def point_masses(scene: Scene, mesh: Mesh, body: str, mass: Array) -> Array:
    """What the point masses of a body add to the mass of each of its nodes [kg], shape (node_count,), float64.

    Args:
        scene: with the point masses.
        mesh, body: of the body, and its name.
        mass: of its nodes without them [kg], shape (node_count,), float64.

    Raises:
        RequestError: one lies outside the body.
    """
    added = np.zeros(len(mesh.points))
    for item in (item for item in scene.masses if item.body == body):
        if item.nodes is None:
            place = np.array(item.at, dtype=np.float64)
            node, weight = around_point(f"{item.title}.at", body, place, mesh)
        else:
            node, weight = weighted_set(mesh.nodes(item.nodes), mass)
        np.add.at(added, node, item.mass * weight)
    return added
