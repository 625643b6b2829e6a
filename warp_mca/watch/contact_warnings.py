"""Owns what a finished run says of contacts whose figures are less sure than they look."""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.physics.contact.surfaces import face_geometry, is_curved_contact
from warp_mca.scene import RigidPlane

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.physics.contact.surfaces import ContactPass
    from warp_mca.scene import Contact
    from warp_mca.watch.ledger import Ledger

Array = NDArray[np.float64]

PATCH = 6.0  # nodes that carry a Hertzian contact three cells across: 8 / 9 of pi / 4 times 3 squared
FACES = 0.3  # of a master, that a curved contact covers; on fewer the force is 5 % too great or more, docs/decisions.md
POINT = 2.5  # nodes that carry a flat contact at least; fewer are a corner, or an edge of one cell
THIN = 0.25  # of a body's thickness from which on nodes of another are said to be deep in it
BOUND = 0.1  # component of a normal along an axis from which on a node that is bound there cannot follow the normal


def resolution_warnings(
    contacts: tuple[Contact, ...], model: Model, ledger: Ledger, depths: Sequence[Array], rigid: Container[str] = ()
) -> list[str]:
    """What a run's contact leaves in doubt, one sentence each.

    Args:
        contacts: of the scene. model: of the scene alone. ledger: of the run.
        depths: of each contact pass, largest penetration of each spring [m], shape (spring_count,).
        rigid: names of rigid bodies.
    """
    found: list[str] = []
    for k, item in enumerate(model.passes):
        contact = contacts[item.contact]
        small = list(_small_patch(contact, model, item, ledger, k)) if item.sign > 0.0 else []
        found += small
        if item.plane is not None:
            found += _pushed_through(contact, model, item, depths[k])
        else:
            found += _sunk_through(contact, model, item, depths[k])
            if item.sign > 0.0 and not small:  # a few nodes do not tell how wide the pressed place is
                found += _coarse_master(contact, model, item, ledger.nodes_at_peak(k), depths[k], rigid)
    return found


def symmetry_of(model: Model) -> dict[int, Array]:
    """Normals of planes of symmetry through each contact [-], shape (plane_count, 3), by contact.

    A plane of symmetry holds some nodes of the slave along an axis, and leaves others free.
    """
    first = [item for item in model.passes if item.sign > 0.0]
    return {item.contact: np.eye(3)[[0.0 < share < 1.0 for share in _held(model, item)]] for item in first}


def _held(model: Model, item: ContactPass) -> list[float]:
    """Share of a pass's slave nodes that are held along each axis [-]."""
    return [float((model.fixed_axes[item.slave] >> axis & 1).mean()) for axis in range(3)]


def _small_patch(contact: Contact, model: Model, item: ContactPass, ledger: Ledger, k: int) -> Iterator[str]:
    planes = sum(share > 0.0 for share in _held(model, item))
    # A plane of symmetry leaves half of the patch, and half of the force on nodes in it.
    count = ledger.nodes_at_peak(k) * math.sqrt(2.0) ** planes
    curved = is_curved_contact(model.X, item)
    if 0.0 < count < (PATCH if curved else POINT):
        at_all = "less than three cells across" if curved else "a corner or an edge"
        yield (
            f"when the force on {contact.slave.body} was greatest, it acted on {count:.1f} nodes, {at_all}: force and "
            "duration depend on the mesh; refine both bodies where they touch"
        )


def _coarse_master(
    contact: Contact, model: Model, item: ContactPass, count: float, depth: Array, rigid: Container[str]
) -> Iterator[str]:
    """A master with faces much wider than a curved contact: it cannot dent there, and is too stiff.

    Args:
        contact, model, item: as in `resolution_warnings`, with one of its passes.
        count: nodes of the slave that carried the greatest force.
        depth: largest penetration of each spring [m], shape (spring_count,), those of slave 0 first.
        rigid: names of rigid bodies, which need not dent.
    """
    from scipy.spatial import KDTree

    assert not isinstance(contact.master, RigidPlane)
    depth = depth.reshape(len(item.slave), -1).max(axis=1)
    touched = np.flatnonzero(depth > 0.5 * depth.max(initial=0.0))
    if contact.master.body in rigid or not (len(touched) and is_curved_contact(model.X, item)):
        return
    patch = count * float(np.mean([_area_around(model.X, item, node) for node in touched.tolist()]))
    area, _ = face_geometry(model.X, item.face)
    nearest = KDTree(model.X[item.face].mean(axis=1)).query(model.X[item.slave[touched]])[1]
    width = math.sqrt(float(np.median(area[nearest])))
    if patch < FACES * width**2:
        yield (
            f"when the force on {contact.slave.body} was greatest, it pressed a place some {math.sqrt(patch):.2g} m "
            f"wide of {contact.master.body}, whose faces there are {width:.2g} m wide: cells so large do not dent as "
            "the body would, so that the force is too great and its time too short; refine the master where they touch"
        )


def _area_around(X: Array, item: ContactPass, node: int) -> float:
    """Area of the surface that belongs to a slave node [m^2]: an equal part of each face around it."""
    faces = item.slave_face[item.face_of_slave[item.slave_offset[node] : item.slave_offset[node + 1]]]
    corners = [len(np.unique(face)) for face in faces]
    return float((face_geometry(X, faces)[0] / corners).sum())


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


def _sunk_through(contact: Contact, model: Model, item: ContactPass, depth: Array) -> Iterator[str]:
    """Guards stop nodes as deep as half a face; a plate that is thinner than its faces are wide is past by then."""
    assert not isinstance(contact.master, RigidPlane)
    slave, master = contact.slave.body, contact.master.body
    if item.sign < 0.0:
        slave, master = master, slave
    thickness = _thickness(model, master)
    deepest = float(depth.max(initial=0.0))
    if deepest > THIN * thickness:
        yield (
            f"nodes of {slave} sank {deepest:.3g} m deep into {master}, which is {thickness:.3g} m thick: contact "
            "springs are too soft for a body so thin; raise penalty, or give both bodies smaller cells"
        )


def _thickness(model: Model, name: str) -> float:
    """Least extent of a body along its principal axes [m]."""
    first = model.node_start[name]
    X = model.X[first : min((k for k in model.node_start.values() if k > first), default=model.node_count)]
    X = X - X.mean(axis=0)
    return float(np.ptp(X @ np.linalg.eigh(X.T @ X)[1], axis=0).min())


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
