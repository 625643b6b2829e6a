"""Owns whether a contact is resolved: meshes whose bodies could cross are refused, doubtful runs say what to change."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.model.surfaces import is_curved_contact
from warp_mca.scene import RigidPlane

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.model.surfaces import ContactPass, Faces
    from warp_mca.runs.ledger import Ledger
    from warp_mca.scene import Contact
    from warp_mca.solve.solver import Solver

Array = NDArray[np.float64]

SOFT = 0.5  # share of the exchanged energy in contact springs from which on they decide the answer
PATCH = 6.0  # nodes that carry a Hertzian contact three cells across: 8 / 9 of pi / 4 times 3 squared
POINT = 2.5  # nodes that carry a flat contact at least; fewer are a corner, or an edge of one cell
FACING = 0.1  # cosine between a face's normal and the direction of approach from which on the face may strike
BOUND = 0.1  # component of a normal along an axis from which on a node that is bound there cannot follow the normal


def check_spacing(contact: Contact, X: Array, V: Array, slave: Faces, master: Faces | None) -> None:
    """Refuse a contact whose bodies can pass between the slave's nodes, since only nodes are kept out.

    Args:
        contact: of the scene.
        X, V: positions [m] and initial velocities [m/s], shape (node_count, 3).
        slave, master: its surfaces; None for a plane.

    Raises:
        RequestError: half of the slave's faces that may strike are longer than the master is wide; in two-way contact,
            those of either side are longer than the other one is wide.
    """
    if master is None:
        return
    sides = [(contact.slave.body, slave, master), (_body(contact), master, slave)]
    spans = [(name, _spacing(X, V, side, other), _width(X, other)) for name, side, other in sides]
    if all(spacing > width for _, spacing, width in spans[: 2 if contact.two_way else 1]):
        name, spacing, width = spans[0]
        raise bad_value(
            f"Contact.slave.body {name}: distance between nodes [m]",
            float(f"{spacing:.4g}"),
            f"body {_body(contact)} is {width:.4g} m wide and could pass between the nodes unseen: refine the mesh of "
            "the slave, or make the finer body the slave",
        )


def _body(contact: Contact) -> str:
    assert not isinstance(contact.master, RigidPlane)
    return contact.master.body


def _spacing(X: Array, V: Array, side: Faces, other: Faces) -> float:
    """Longest edge of the usual face of a surface that may strike the other one [m]."""
    corners = X[side.node]
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    approach = V[side.nodes].mean(axis=0) - V[other.nodes].mean(axis=0)
    facing = side.normal @ approach > FACING * side.area * np.linalg.norm(approach)
    return float(np.median(longest[facing] if facing.any() else longest))


def _width(X: Array, side: Faces) -> float:
    """Width of a surface across its longest principal axis [m]: of a plate its width, of a rod its diameter.

    It is the longer side of the smallest rectangle around the surface, seen along that axis.
    """
    points = X[side.nodes] - X[side.nodes].mean(axis=0)
    _, _, axes = np.linalg.svd(points, full_matrices=False)
    across = points @ axes[1:].T
    angle = np.radians(np.arange(90.0))
    sides = np.stack([np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)], axis=1).reshape(-1, 2, 2)
    extents = np.array([np.ptp(across @ turned.T, axis=0) for turned in sides])
    return float(extents[extents.prod(axis=1).argmin()].max())


def resolution_warnings(
    contacts: tuple[Contact, ...], model: Model, ledger: Ledger, solver: Solver, scene: int
) -> list[str]:
    """What a run's contact leaves in doubt, one sentence each.

    Args:
        contacts: of the scene. model: of the scene alone. ledger: of the run.
        solver: that ran it; scene: its number there.
    """
    found = list(_soft(ledger))
    for k, item in enumerate(model.passes):
        contact = contacts[item.contact]
        if item.sign > 0.0:
            found += _small_patch(contact, model, item, ledger, k)
        if item.plane is not None:
            found += _pushed_through(contact, model, item, solver.contacts[k].depths(scene))
    return found


def _soft(ledger: Ledger) -> Iterator[str]:
    share = ledger.greatest_contact_share
    if share > SOFT:
        yield (
            f"contact springs held up to {share:.0%} of the energy that the bodies exchanged, so forces and durations "
            "are those of the springs: raise the contact's penalty or leave it to its default, or refine the mesh there"
        )


def _small_patch(contact: Contact, model: Model, item: ContactPass, ledger: Ledger, k: int) -> Iterator[str]:
    planes = sum(bool((model.fixed_axes[item.slave] >> axis & 1).any()) for axis in range(3))
    # A plane of symmetry leaves half of the patch, and half of the force on nodes in it.
    count = ledger.nodes_at_peak(k) * math.sqrt(2.0) ** planes
    curved = is_curved_contact(model.X, item)
    if 0.0 < count < (PATCH if curved else POINT):
        at_all = "less than three cells across" if curved else "a corner or an edge"
        yield (
            f"when the force on {contact.slave.body} was greatest, it acted on {count:.1f} nodes, {at_all}: force and "
            "duration depend on the mesh; refine both bodies where they touch"
        )


def _pushed_through(contact: Contact, model: Model, item: ContactPass, depth: Array) -> Iterator[str]:
    assert item.plane is not None
    normal = np.asarray(item.plane.normal, dtype=float)
    speed = _bound_speed(model, item.slave, normal / np.linalg.norm(normal))
    pushed = (speed < 0.0) & (depth > 0.0)
    if pushed.any():
        yield (
            f"{int(pushed.sum())} nodes of {contact.slave.body} were driven into the plane, up to "
            f"{depth[pushed].max():.3g} m deep: contact cannot move a node whose motion is prescribed, so the force "
            "there is only stiffness times depth; leave these nodes out of the contact's surface, or drive others"
        )


def _bound_speed(model: Model, nodes: NDArray[np.int32], normal: Array) -> Array:
    """Least speed along a normal of nodes that are bound along it [m/s]; 0 of those that are free."""
    axes = np.flatnonzero(np.abs(normal) > BOUND)
    least = np.zeros((model.node_count, 3))
    bound = np.zeros((model.node_count, 3), dtype=bool)
    for axis in range(3):
        bound[:, axis] = (model.fixed_axes >> axis) & 1 == 1
        least[bound[:, axis], axis] = normal[axis] * model.V[bound[:, axis], axis]
    for node, axis, table in zip(model.prescribed_node, model.prescribed_axis, model.prescribed_table, strict=True):
        values = model.table_value[model.table_offset[table] : model.table_offset[table + 1]]
        bound[node, axis], least[node, axis] = True, (normal[axis] * values).min()
    return np.where(bound[nodes][:, axes].all(axis=1), least[nodes].sum(axis=1), 0.0)
