"""Owns `Model`: a scene, its meshes and its initial motion as flat arrays that never change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.geometry.mesh import Mesh
from warp_mca.model.assembly import GROUND, Assembly, Block, body_cells, body_materials, nodal_masses
from warp_mca.model.constraints import JointPairs, check_bindings, constraints, free_nodes, join_bodies
from warp_mca.model.contact_checks import check_spacing
from warp_mca.model.couplings import Coupling
from warp_mca.model.joint_loads import HingeLoad, MovableBase, hinge_loads, movable_bases
from warp_mca.model.layout import Layout
from warp_mca.model.rigid_bodies import RigidBody, check_loads, flexible, own_nodes, rigid_bodies
from warp_mca.model.rigid_rows import RigidPin, RigidRow
from warp_mca.model.rigid_step import bounce_factor, stable_with_rigid
from warp_mca.model.stable_step import StableStep
from warp_mca.model.surfaces import ContactPass, Faces, contact_eigenvalues, contact_passes
from warp_mca.scene import Contact, RigidPlane, Scene

if TYPE_CHECKING:
    from warp_mca.rigid.chain import Chain

Array = NDArray[np.float64]
Index = NDArray[np.int32]

__all__ = ["GROUND", "Block", "Model", "body_cells", "body_materials", "build_model", "nodal_masses"]

CLOSED = 1e-6  # share of a surface's area below which its normals cancel
PARALLEL = 1e-6  # sine of the angle between directions that count as one
NEAR_Z = 0.342  # sine of the angle from the z axis, below which tangents are not taken along n x z
_SAMPLES = np.array([0.125, 0.375, 0.625, 0.875])  # along both edges of a face, where its distance is taken


@dataclass(frozen=True, kw_only=True)
class Model:
    """Everything the solver needs, as host arrays.

    Attributes:
        X: reference positions, those at hand-off [m], shape (node_count, 3), float64.
        V: initial velocities [m/s], shape (node_count, 3), float64.
        mass: lumped masses [kg], shape (node_count,), float64.
        blocks: elements by kernel.
        law: parameters of each material, as `Elastic.parameters` has them, then zeros, shape (material_count,
            parameters of the longest), float64.
        fixed_axes: bits 0, 1, 2 hold the axes x, y, z of each node, shape (node_count,), int32.
        prescribed_node, prescribed_axis, prescribed_table: one entry for each driven axis of a node, int32.
        table_offset: start of each table, shape (table_count + 1,), int32.
        table_time, table_value: [s] and [m/s], float64.
        joint_first, joint_second: tied nodes, shape (pair_count,), int32; GROUND has no second node.
        joint_tied: orthogonal projector on the directions in which pairs move as one [-], shape (pair_count, 3, 3),
            float64.
        joint_slides: of each rail the first of its sliders, the first of its own nodes and the end of these in
            `joint_first`, shape (rail_count, 3), int32. They count as pairs that are tied in no direction.
        joints: name of each joint and its pairs.
        couplings: of joints between clusters of nodes; their pairs count as tied in no direction. Those of rigid bodies
            are in `rigid_rows` and `rigid_pins`.
        hinge_loads: torques and friction in hinges of chains; those of each scene in turn.
        bases: of chains, that move or slide; their pairs count as tied in no direction.
        passes: contact passes; those of each scene in turn.
        contact_axes: normal and tangent along which forces of each contact are reported [-], shape (contact_count, 2,
            3), float64; a closed master has no normal, which is zero then: normal forces add up as they are.
        gravity: of each scene [m/s^2], shape (scene_count, 3), float64.
        points: nodes whose velocity is recorded (tip, target, others; those of each scene in turn), shape
            (point_count,), int32; GROUND where there is none.
        node_start, element_start: first node and element of each body in the concatenated meshes, by name.
        element_of: position of each element in the concatenated meshes, shape (element_count,), int32.
        stable: the stable time step.
        batch: where the scenes of a batch lie, or None for a model of one scene.
        rigid_bodies, rigid_rows, rigid_pins: rigid bodies, those of each scene in turn, and what binds them.
        rigid_blocks: their elements, which are shown but not computed; `element_of` lists them behind the others. Empty
            in a batch.
    """

    X: Array
    V: Array
    mass: Array
    blocks: tuple[Block, ...]
    law: Array
    fixed_axes: Index
    prescribed_node: Index
    prescribed_axis: Index
    prescribed_table: Index
    table_offset: Index
    table_time: Array
    table_value: Array
    joint_first: Index
    joint_second: Index
    joint_tied: Array
    joint_slides: Index
    joints: tuple[JointPairs, ...]
    couplings: tuple[Coupling, ...]
    hinge_loads: tuple[HingeLoad, ...]
    bases: tuple[MovableBase, ...]
    passes: tuple[ContactPass, ...]
    contact_axes: Array
    gravity: Array
    points: Index
    node_start: Mapping[str, int]
    element_start: Mapping[str, int]
    element_of: Index
    stable: StableStep
    batch: Layout | None = None
    rigid_bodies: tuple[RigidBody, ...] = ()
    rigid_rows: tuple[RigidRow, ...] = ()
    rigid_pins: tuple[RigidPin, ...] = ()
    rigid_blocks: tuple[Block, ...] = ()

    def owner(self, element: int) -> tuple[str, int]:
        """Body that an element of the concatenated meshes belongs to, and the element's index in that body's mesh."""
        first, name = max((first, name) for name, first in self.element_start.items() if first <= element)
        return name, element - first

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return len(self.X)

    @property
    def element_count(self) -> int:
        """Number of elements that are computed."""
        return sum(block.conn.shape[1] for block in self.blocks)


def _contacts(parts: Assembly, velocity: Array) -> tuple[tuple[ContactPass, ...], Array, Array]:
    """Passes, the axes along which each contact's force is reported, and what the springs add at each node."""
    passes: list[ContactPass] = []
    axes = np.zeros((len(parts.scene.contacts), 2, 3))
    added = np.zeros(len(parts.X))
    for index, contact in enumerate(parts.scene.contacts):
        slave = parts.faces(contact.slave)
        master = None if isinstance(contact.master, RigidPlane) else parts.faces(contact.master)
        check_spacing(contact, parts.X, velocity, slave, master)
        for item in contact_passes(contact, index, slave, master):
            sides = (slave, master) if item.sign > 0.0 else (master, slave)
            assert sides[0] is not None
            nodes, value = contact_eigenvalues(item, sides[0], sides[1], parts.mass)
            np.add.at(added, nodes, bounce_factor(contact, parts.scene) * value)
            passes.append(item)
        axes[index] = _axes(parts.X, contact, slave, master)
    return tuple(passes), axes, added


def _axes(X: Array, contact: Contact, slave: Faces, master: Faces | None) -> tuple[Array, Array]:
    """Normal and tangent of a contact, as `Model.contact_axes`.

    Raises:
        RequestError: the tangent asked for is along the normal.
    """
    if contact.normal is not None:
        normal = along = np.array(contact.normal, dtype=float)
    elif master is None:
        assert isinstance(contact.master, RigidPlane)
        normal = along = np.array(contact.master.normal, dtype=float)
    else:
        normal, along = _surface_normals(X, slave, master)
    size = np.linalg.norm(normal)
    unit = normal / size if size > 0.0 else normal
    if contact.tangent is None:
        return unit, _tangent(along)
    try:
        return unit, perpendicular(np.array(contact.tangent, dtype=float), along)
    except ValueError as error:
        remedy = f"the contact's normal is along it; give a direction across {tuple(along.tolist())}"
        raise bad_value("Contact.tangent", contact.tangent, remedy) from error


def perpendicular(direction: Array, normal: Array) -> Array:
    """Unit vector along the part of a direction that is perpendicular to the normal.

    Raises:
        ValueError: there is none.
    """
    n, d = normal / np.linalg.norm(normal), direction / np.linalg.norm(direction)
    across = d - (d @ n) * n
    size = np.linalg.norm(across)
    if size < PARALLEL:
        raise ValueError(direction)
    return across / size


def _tangent(normal: Array) -> Array:
    """Unit vector along n x z; within 20 degrees of the z axis, where that turns with any tilt of n, nearest to +x."""
    tangent = np.cross(normal / np.linalg.norm(normal), [0.0, 0.0, 1.0])
    size = np.linalg.norm(tangent)
    return tangent / size if size > NEAR_Z else perpendicular(np.array([1.0, 0.0, 0.0]), normal)


def _mean_normal(faces: Faces) -> Array | None:
    """Normals of a surface's faces, added up by their area [m^2], or None where it is closed: then they cancel."""
    normal = faces.normal.sum(axis=0)
    return None if np.linalg.norm(normal) < CLOSED * faces.area.sum() else normal


def _surface_normals(X: Array, slave: Faces, master: Faces) -> tuple[Array, Array]:
    """Normal of a master, of any length, and the direction across which tangential force is reported.

    A closed master has no one normal, which is 0 then, but where it is touched it faces the slave: the direction is
    that of the slave's mean normal turned round or, where the slave is closed too, of the master's own faces where the
    bodies are nearest to each other.
    """
    normal = _mean_normal(master)
    if normal is not None:
        return normal, normal
    other = _mean_normal(slave)
    return np.zeros(3), _nearest_normal(X, slave, master) if other is None else -other


def _nearest_normal(X: Array, slave: Faces, master: Faces) -> Array:
    """Normals of the master's faces nearest to the slave, added up by area [m^2]; y where they surround it."""
    from scipy.spatial import KDTree

    a, b = (part.ravel() for part in np.meshgrid(_SAMPLES, _SAMPLES))
    weight = np.stack([(1.0 - a) * (1.0 - b), a * (1.0 - b), a * b, (1.0 - a) * b])
    samples = KDTree(np.einsum("kp,fkc->fpc", weight, X[master.node]).reshape(-1, 3))
    nodes = X[slave.nodes]
    distance, _ = samples.query(nodes)
    reach = distance.min() + 0.25 * np.sqrt(np.median(master.area))
    near = np.concatenate(samples.query_ball_point(nodes[distance <= reach], reach)).astype(np.int32)
    touched = np.unique(near // len(a))
    mean = master.normal[touched].sum(axis=0)
    return mean if np.linalg.norm(mean) > CLOSED * master.area[touched].sum() else np.array([0.0, 1.0, 0.0])


@np.errstate(over="ignore", invalid="ignore")  # `stable_step` raises for values that are not finite
def build_model(
    scene: Scene,
    meshes: Mapping[str, Mesh],
    X: Mapping[str, Array],
    V: Mapping[str, Array],
    watched: Sequence[tuple[str, int]] = (),
    *,
    chain: Chain | None = None,
    start: float = 0.0,
) -> Model:
    """Assemble a scene whose bodies stand at X [m] and move with V [m/s], by body, shape (node_count, 3), float64.

    `watched` are nodes whose velocity is recorded beside that of tip and target, by body and index in its mesh. What
    acts in the joints of a `chain` and moves its base goes on, from `start` on [s], counted from the release.

    Raises:
        RequestError: joints whose nodes do not coincide, nodes bound twice, unknown sets, cells without material.
    """
    parts = Assembly(scene, meshes, X)
    others = [parts.node_start[body] + node for body, node in watched]
    pairs, joints, couplings = join_bodies(parts)
    soft = flexible(couplings, pairs, own_nodes(parts))
    bases = movable_bases(parts, joints, soft, chain, start)
    check_loads(scene, chain, bases)
    for base in bases:
        pairs["joint_tied"][base.start : base.end] = 0.0
    blocks, order = parts.blocks()
    rigid_blocks, rigid_order = parts.blocks(rigid=True, first=len(order))
    velocity = np.concatenate([V[body.name] for body in scene.bodies])
    held = constraints(parts, velocity)
    check_bindings(held, pairs)
    passes, axes, added = _contacts(parts, velocity)
    rigid = rigid_bodies(parts, pairs, joints, couplings, passes, velocity)
    stable = stable_with_rigid(parts, rigid.bodies, added, velocity) if rigid.bodies else parts.stable(added)
    return Model(
        X=parts.X,
        V=velocity,
        mass=parts.mass,
        blocks=blocks,
        law=parts.law(),
        **held,
        **pairs,
        joints=joints,
        couplings=soft,
        hinge_loads=hinge_loads(parts, free_nodes(held, pairs), chain, start),
        bases=bases,
        passes=passes,
        contact_axes=axes,
        gravity=np.array([scene.gravity], dtype=np.float64),
        points=np.array([parts.nearest(scene.tip), parts.nearest(scene.target), *others], dtype=np.int32),
        node_start=parts.node_start,
        element_start=parts.element_start,
        element_of=np.concatenate([order, rigid_order]),
        stable=stable,
        batch=None,
        rigid_bodies=rigid.bodies,
        rigid_rows=rigid.rows,
        rigid_pins=rigid.pins,
        rigid_blocks=rigid_blocks,
    )
