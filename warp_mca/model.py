"""Owns `Model`: a scene, its meshes and its initial motion turned into flat arrays that never change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.element import jacobians, lumped_masses
from warp_mca.errors import RequestError, bad_value
from warp_mca.geometry.mesh import Mesh
from warp_mca.scene import Body, Elastic, J2Bilinear, Point, RigidPlane, Scene, Surface
from warp_mca.surfaces import ContactPass, Faces, contact_eigenvalues, contact_passes, face_geometry, make_faces
from warp_mca.timestep import StableStep, stable_step

Array = NDArray[np.float64]
Index = NDArray[np.int32]

GROUND = -1


@dataclass(frozen=True, kw_only=True)
class Block:
    """Elements that run the same kernel.

    Attributes:
        plastic: whether they keep a plastic history.
        conn: nodes of each element, shape (8, element_count), int32.
        material: row of `Model.law`, shape (element_count,), int32.
        first: index of the first element in the model.
    """

    plastic: bool
    conn: Index
    material: Index
    first: int

    @property
    def slot(self) -> int:
        """Where the block's element forces start in the force array."""
        return 8 * self.first


@dataclass(frozen=True, kw_only=True)
class Hinge:
    """A revolute joint: pairs [start, end) of `Model.joint_first` and `joint_second`."""

    name: str
    start: int
    end: int


@dataclass(frozen=True, kw_only=True)
class Model:
    """Everything the solver needs, as host arrays.

    Attributes:
        X: reference positions, those at hand-off [m], shape (node_count, 3), float64.
        V: initial velocities [m/s], shape (node_count, 3), float64.
        mass: lumped masses [kg], shape (node_count,), float64.
        blocks: elements by kernel.
        law: K, G, sigma_y, H [Pa] and beta [-] of each material, shape (material_count, 5), float64.
        gather_offset, gather_slot: element forces of each node, compressed rows, int32.
        fixed_axes: bits 0, 1, 2 hold the axes x, y, z of each node, shape (node_count,), int32.
        prescribed_node, prescribed_axis, prescribed_table: one entry for each driven axis of a node, int32.
        table_offset: start of each table, shape (table_count + 1,), int32.
        table_time, table_value: [s] and [m/s], float64.
        joint_first, joint_second: tied nodes, shape (pair_count,), int32; GROUND has no second node.
        hinges: the joints that own the pairs.
        passes: contact passes.
        contact_axes: normal and tangent of each contact [-], shape (contact_count, 2, 3), float64.
        gravity: [m/s^2], shape (3,), float64.
        points: nodes whose velocity is recorded (tip, target), shape (2,), int32; GROUND where there is none.
        node_start, element_start: first node and element of each body in the concatenated meshes, by name.
        element_of: position of each element in the concatenated meshes, shape (element_count,), int32.
        stable: the stable time step.
    """

    X: Array
    V: Array
    mass: Array
    blocks: tuple[Block, ...]
    law: Array
    gather_offset: Index
    gather_slot: Index
    fixed_axes: Index
    prescribed_node: Index
    prescribed_axis: Index
    prescribed_table: Index
    table_offset: Index
    table_time: Array
    table_value: Array
    joint_first: Index
    joint_second: Index
    hinges: tuple[Hinge, ...]
    passes: tuple[ContactPass, ...]
    contact_axes: Array
    gravity: Array
    points: Index
    node_start: Mapping[str, int]
    element_start: Mapping[str, int]
    element_of: Index
    stable: StableStep

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return len(self.X)

    @property
    def element_count(self) -> int:
        """Number of elements."""
        return len(self.element_of)


def body_materials(body: Body, mesh: Mesh) -> list[tuple[Elastic, Index]]:
    """Materials of a body with the elements that each fills; together they fill the body.

    Raises:
        RequestError: a named cell set is unknown, or cells are left without material.
    """
    if isinstance(body.material, Elastic):
        return [(body.material, np.arange(len(mesh.hexahedra), dtype=np.int32))]
    owner = np.full(len(mesh.hexahedra), -1, dtype=np.int32)
    listed = list(body.material.items())
    for k, (name, _) in enumerate(listed):
        if name == "*":
            owner[owner < 0] = k
        elif name in mesh.cell_sets:
            owner[mesh.cell_sets[name]] = k
        else:
            known = ", ".join(sorted(mesh.cell_sets)) or "none"
            raise bad_value(f"Body {body.name}.material", name, f"the mesh's cell sets are {known}; or use '*'")
    if (owner < 0).any():
        raise bad_value(f"Body {body.name}.material", [n for n, _ in listed], "some cells have none; add a '*' entry")
    return [(m, np.flatnonzero(owner == k).astype(np.int32)) for k, (_, m) in enumerate(listed)]


def _sum_to_nodes(hexahedra: Index, value: Array, node_count: int) -> Array:
    """Sum of what each element gives its corners, shape (node_count,), float64."""
    return np.bincount(hexahedra.ravel(), value.ravel(), minlength=node_count).astype(np.float64)


def nodal_masses(scene: Scene, meshes: Mapping[str, Mesh]) -> dict[str, Array]:
    """Lumped nodal masses [kg] of each body, shape (node_count,), float64: what carries the momentum."""
    masses = {}
    for body in scene.bodies:
        mesh = meshes[body.name]
        rho = np.empty(len(mesh.hexahedra))
        for material, cells in body_materials(body, mesh):
            rho[cells] = material.rho
        element_mass = lumped_masses(mesh.points[mesh.hexahedra], rho)
        masses[body.name] = _sum_to_nodes(mesh.hexahedra, element_mass, len(mesh.points))
    return masses


class _Assembly:
    """Concatenated meshes of a scene on the way to a Model."""

    def __init__(self, scene: Scene, meshes: Mapping[str, Mesh], X: Mapping[str, Array]) -> None:
        self.scene, self.meshes = scene, meshes
        self.node_start: dict[str, int] = {}
        self.element_start: dict[str, int] = {}
        nodes = elements = 0
        for body in scene.bodies:
            self.node_start[body.name], self.element_start[body.name] = nodes, elements
            nodes += len(meshes[body.name].points)
            elements += len(meshes[body.name].hexahedra)
        self.X = np.concatenate([X[body.name] for body in scene.bodies])
        self.hexahedra = np.concatenate([meshes[b.name].hexahedra + self.node_start[b.name] for b in scene.bodies])
        self.materials: list[Elastic] = []
        self.material = np.empty(elements, dtype=np.int32)
        for body in scene.bodies:
            for material, cells in body_materials(body, meshes[body.name]):
                if material not in self.materials:
                    self.materials.append(material)
                self.material[cells + self.element_start[body.name]] = self.materials.index(material)
        self.K = np.array([m.bulk_modulus for m in self.materials])[self.material]
        self.G = np.array([m.shear_modulus for m in self.materials])[self.material]
        rho = np.array([m.rho for m in self.materials])[self.material]
        corners = self.X[self.hexahedra]
        self.element_mass = lumped_masses(corners, rho)
        self.volume = np.linalg.det(jacobians(corners)).sum(axis=1)
        self.mass = _sum_to_nodes(self.hexahedra, self.element_mass, len(self.X))

    def law(self) -> Array:
        """Rows of K, G, sigma_y, H, beta; an elastic material never yields."""
        rows = []
        for m in self.materials:
            plastic = (m.sigma_y, m.hardening_modulus, m.beta) if isinstance(m, J2Bilinear) else (0.0, 0.0, 0.0)
            rows.append((m.bulk_modulus, m.shear_modulus, *plastic))
        return np.array(rows)

    def blocks(self) -> tuple[tuple[Block, ...], Index]:
        """Elements grouped by kernel, and the order that this gives them."""
        plastic = np.array([isinstance(m, J2Bilinear) for m in self.materials])[self.material]
        blocks, order = [], []
        for flag in (True, False):
            cells = np.flatnonzero(plastic == flag).astype(np.int32)
            if len(cells):
                first = sum(len(c) for c in order)
                conn = np.ascontiguousarray(self.hexahedra[cells].T)
                blocks.append(Block(plastic=flag, conn=conn, material=self.material[cells], first=first))
                order.append(cells)
        return tuple(blocks), np.concatenate(order)

    def nodes(self, body: str, name: str) -> Index:
        return self.meshes[body].nodes(name) + self.node_start[body]

    def faces(self, surface: Surface) -> Faces:
        node, element = self.meshes[surface.body].surface(surface.nodes)
        node = (node + self.node_start[surface.body]).astype(np.int32)
        element = (element + self.element_start[surface.body]).astype(np.int32)
        return make_faces(self.X, node, element, self.K, self.volume)

    def nearest(self, point: Point | None) -> int:
        if point is None:
            return GROUND
        offsets = self.meshes[point.body].points - np.asarray(point.at)
        return int(np.argmin((offsets**2).sum(axis=1))) + self.node_start[point.body]


def _gather(blocks: tuple[Block, ...], node_count: int) -> tuple[Index, Index]:
    """Slots of the element forces of each node as compressed rows."""
    node = np.concatenate([block.conn.ravel() for block in blocks])
    slot = np.concatenate([block.slot + np.arange(block.conn.size) for block in blocks])
    order = np.argsort(node, kind="stable")
    offset = np.searchsorted(node[order], np.arange(node_count + 1))
    return offset.astype(np.int32), slot[order].astype(np.int32)


def _constraints(parts: _Assembly, V: Array) -> dict[str, NDArray]:
    """Axes at rest as bits; driven axes, fixed ones that move included, as tables, because they do work."""
    fixed_axes = np.zeros(len(parts.X), dtype=np.int32)
    node, axis, table = [], [], []
    offset, time, value = [0], [], []

    def drive(nodes: Index, k: int, times: tuple[float, ...], values: tuple[float, ...]) -> None:
        node.append(nodes)
        axis.append(np.full(len(nodes), k))
        table.append(np.full(len(nodes), len(offset) - 1))
        time.extend(times)
        value.extend(values)
        offset.append(len(time))

    for item in parts.scene.fixed:
        nodes = parts.nodes(item.body, item.nodes)
        for letter in item.axes:
            k = "xyz".index(letter)
            fixed_axes[nodes[V[nodes, k] == 0.0]] |= 1 << k
            for speed in np.unique(V[nodes, k]):
                if speed != 0.0:
                    drive(nodes[V[nodes, k] == speed], k, (0.0,), (float(speed),))
    for item in parts.scene.prescribed:
        drive(parts.nodes(item.body, item.nodes), "xyz".index(item.axis), item.times, item.velocities)

    def join(items: list[NDArray]) -> Index:
        return np.concatenate(items).astype(np.int32) if items else np.zeros(0, np.int32)

    return {
        "fixed_axes": fixed_axes,
        "prescribed_node": join(node),
        "prescribed_axis": join(axis),
        "prescribed_table": join(table),
        "table_offset": np.array(offset, dtype=np.int32),
        "table_time": np.array(time, dtype=np.float64),
        "table_value": np.array(value, dtype=np.float64),
    }


def _axis_nodes(mesh: Mesh, at: Array, axis: Array, both_ends: bool) -> tuple[Index, Array]:
    """Nodes on a hinge axis, sorted along it, and their coordinates along it [m]."""
    axis = axis / np.linalg.norm(axis)
    offset = mesh.points - at
    along = offset @ axis
    away = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    nodes = np.flatnonzero(away <= 1e-6 * np.ptp(mesh.points, axis=0).max())
    nodes = nodes[np.argsort(along[nodes])]
    if both_ends:
        nodes = nodes[[0, -1]] if len(nodes) > 1 else nodes
    return nodes.astype(np.int32), along[nodes]


def _joints(parts: _Assembly) -> tuple[Index, Index, tuple[Hinge, ...]]:
    """Pairs of tied nodes.

    Raises:
        RequestError: fewer than two nodes of a body lie on the axis, or the pairs do not coincide.
    """
    first, second, hinges = [], [], []
    for joint in parts.scene.joints:
        ends = joint.nodes == "ends"
        axis = np.asarray(joint.axis)
        a, along = _axis_nodes(parts.meshes[joint.body], np.asarray(joint.at), axis, ends)
        if len(a) < 2:
            raise bad_value(
                f"Revolute {joint.name}.at",
                joint.at,
                f"{len(a)} nodes of {joint.body} lie on this axis; two are needed",
            )
        a = a + parts.node_start[joint.body]
        b = np.full(len(a), GROUND, dtype=np.int32)
        if joint.other is not None:
            b, other_along = _axis_nodes(parts.meshes[joint.other], np.asarray(joint.other_at), axis, ends)
            b = b + parts.node_start[joint.other]
            alike = len(a) == len(b)
            apart = float(np.linalg.norm(parts.X[a] - parts.X[b], axis=1).max()) if alike else np.inf
            if apart > 1e-6 * max(np.ptp(along), np.ptp(other_along)):
                what = f"{len(a)} nodes of {joint.body} and {len(b)} of {joint.other}, up to {apart:.3g} m apart"
                raise bad_value(
                    f"Revolute {joint.name}.nodes",
                    joint.nodes,
                    f"they do not coincide ({what}); mesh both alike at the axis",
                )
            parts.X[b] = parts.X[a]
        start = sum(len(item) for item in first)
        hinges.append(Hinge(name=joint.name, start=start, end=start + len(a)))
        first.append(a)
        second.append(b)
    if not first:
        return np.zeros(0, np.int32), np.zeros(0, np.int32), ()
    pairs = np.concatenate(first), np.concatenate(second)
    tied = np.concatenate([pairs[0], pairs[1][pairs[1] != GROUND]])
    if len(np.unique(tied)) < len(tied):
        raise RequestError("Scene.joints: a node is tied twice; give each joint, of two bodies, an axis of its own")
    return pairs[0].astype(np.int32), pairs[1].astype(np.int32), tuple(hinges)


def _check_bindings(held: dict[str, NDArray], first: Index, second: Index) -> None:
    """Refuse nodes that are bound twice: each stage would undo what the other set.

    Raises:
        RequestError: an axis is driven twice, or fixed and driven; a hinge's node is fixed or driven.
    """
    node, axis = held["prescribed_node"], held["prescribed_axis"]
    if len(np.unique(3 * node + axis)) < len(node) or ((held["fixed_axes"][node] >> axis) & 1).any():
        raise RequestError("Scene.prescribed: an axis of a node is bound twice; drive or fix it once")
    bound = held["fixed_axes"] != 0
    bound[node] = True
    if bound[first].any() or bound[second[second != GROUND]].any():
        raise RequestError("Scene.joints: a node on a hinge is also fixed or driven; bind other nodes of that body")


def _contacts(parts: _Assembly) -> tuple[tuple[ContactPass, ...], Array, Array]:
    """Passes, the axes along which each contact's force is reported, and what the springs add at each element."""
    passes: list[ContactPass] = []
    axes = np.zeros((len(parts.scene.contacts), 2, 3))
    added = np.zeros(len(parts.X))
    for index, contact in enumerate(parts.scene.contacts):
        slave = parts.faces(contact.slave)
        master = None if isinstance(contact.master, RigidPlane) else parts.faces(contact.master)
        for item in contact_passes(contact, index, slave, master):
            sides = (slave, master) if item.sign > 0.0 else (master, slave)
            assert sides[0] is not None
            nodes, value = contact_eigenvalues(item, sides[0], sides[1], parts.mass)
            np.add.at(added, nodes, value)
            passes.append(item)
        if isinstance(contact.master, RigidPlane):
            normal = np.asarray(contact.master.normal, dtype=float)
        else:
            assert master is not None
            normal = face_geometry(parts.X, master.node)[1].sum(axis=0)
            closed = np.linalg.norm(normal) < 1e-6 * master.area.sum()
            normal = np.array([0.0, 1.0, 0.0]) if closed else normal
        normal = normal / np.linalg.norm(normal)
        tangent = np.cross(normal, [0.0, 0.0, 1.0])
        size = np.linalg.norm(tangent)
        axes[index] = normal, tangent / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
    return tuple(passes), axes, added[parts.hexahedra].max(axis=1)


def build_model(scene: Scene, meshes: Mapping[str, Mesh], X: Mapping[str, Array], V: Mapping[str, Array]) -> Model:
    """Assemble a scene whose bodies stand at X [m] and move with V [m/s], by body, shape (node_count, 3), float64.

    Raises:
        RequestError: joints whose nodes do not coincide, nodes bound twice, unknown sets, cells without material.
    """
    parts = _Assembly(scene, meshes, X)
    first, second, hinges = _joints(parts)
    blocks, order = parts.blocks()
    offset, slot = _gather(blocks, len(parts.X))
    velocity = np.concatenate([V[body.name] for body in scene.bodies])
    held = _constraints(parts, velocity)
    _check_bindings(held, first, second)
    passes, axes, added = _contacts(parts)
    stable = stable_step(parts.X[parts.hexahedra], parts.K, parts.G, parts.element_mass, added)
    return Model(
        X=parts.X,
        V=velocity,
        mass=parts.mass,
        blocks=blocks,
        law=parts.law(),
        gather_offset=offset,
        gather_slot=slot,
        **held,
        joint_first=first,
        joint_second=second,
        hinges=hinges,
        passes=passes,
        contact_axes=axes,
        gravity=np.asarray(scene.gravity, dtype=np.float64),
        points=np.array([parts.nearest(scene.tip), parts.nearest(scene.target)], dtype=np.int32),
        node_start=parts.node_start,
        element_start=parts.element_start,
        element_of=order,
        stable=stable,
    )
