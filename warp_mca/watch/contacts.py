"""Owns the rows about contacts that meshes or springs do not resolve."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.physics.contact.sides import face_geometry
from warp_mca.scene import RigidPlane
from warp_mca.watch.row import Array, Context, Finished, Kind, Values, When, listed_passes, row

if TYPE_CHECKING:
    from warp_mca.system.contact import ContactPass
    from warp_mca.system.model import Model

PATCH = 6.0  # nodes that carry a Hertzian contact three cells across: 8 / 9 of pi / 4 times 3 squared
PRESSED = 0.2  # of the greatest depth of a surface's nodes, from which on they bear what presses it
FLUSH = 0.2  # distance of surfaces that lie on each other, over the width of a face, at most
BOUND = 0.1  # component of a normal along an axis from which on a node that is bound there cannot follow the normal


@row(
    "when the force on {body} was greatest, it acted on {count:.1f} nodes, {at_all}: force and duration depend on the "
    "mesh;",
    "refine both bodies where they touch",
    PATCH,
    "nodes at least where surfaces are curved, three cells across; a face pressed at all corners where they are flat",
)
def small_patch(c: Finished, patch: float) -> Iterator[Values]:
    """Nodes that carried each contact when its force was greatest."""
    by_nodes = {item.contact for k, item in enumerate(c.model.passes) if item.leads and c.ledger.nodes_at_peak(k)}
    for k, item, contact in listed_passes(c.scene, c.model):
        alone = item.leads or (item.sign > 0.0 and item.contact not in by_nodes)  # edges
        if alone and contact.stiffness is None and (count := _few_nodes(c, k, patch)):
            at_all = "less than three cells across" if item.curved else "a corner or an edge"
            yield dict(body=contact.slave.body, count=count, at_all=at_all)


@row(
    "{pushed} nodes of {body} were driven into the plane, up to {depth:.3g} m deep: contact cannot move a node whose "
    "motion is prescribed, so the force there is only stiffness times depth;",
    "leave these nodes out of the contact's surface, or drive others",
)
def driven_into_a_plane(c: Finished, _: float) -> Iterator[Values]:
    """Depth of nodes that are fixed or driven along the normal of a rigid plane."""
    for k, item, contact in listed_passes(c.scene, c.model):
        if item.plane is not None:
            depth = c.depths[k]
            normal = np.asarray(item.plane.normal, dtype=float)
            speed = _bound_speed(c.model, item.slave, normal / np.linalg.norm(normal))
            pushed = (speed < 0.0) & (depth > 0.0)
            if pushed.any():
                yield dict(pushed=int(pushed.sum()), body=contact.slave.body, depth=depth[pushed].max())


@row(
    "nodes of {slave} sank {depth:.3g} m deep into {master}, which is {thickness:.3g} m thick: contact springs are too "
    "soft for a body so thin;",
    "raise penalty, or give both bodies smaller cells",
    0.1,
    "of the thickness at most",
)
def deep_in_a_thin_body(c: Finished, most: float) -> Iterator[Values]:
    """Greatest depth of nodes; half a face, which a guard allows, may be wider than a plate is thick."""
    for k, item, contact in listed_passes(c.scene, c.model):
        if isinstance(contact.master, RigidPlane):
            continue
        slave, master = contact.slave.body, contact.master.body
        if item.sign < 0.0:
            slave, master = master, slave
        thickness, deepest = _thickness(c.model.X[c.nodes(master)]), float(c.depths[k].max(initial=0.0))
        if deepest > most * thickness:
            yield dict(slave=slave, depth=deepest, master=master, thickness=thickness)


@row(
    "when the force on {slave} was greatest, it pressed a place some {patch:.2g} m wide of {master}, whose faces there "
    "are {width:.2g} m wide: cells so large do not dent as the body would, so that the force is too great and its time "
    "too short;",
    "refine the master where they touch",
    0.3,
    "of a face at least; on less the force is 5 % too great or more (docs/decisions.md)",
)
def undented_master(c: Finished, least: float) -> Iterator[Values]:
    """Area of a curved contact over that of the faces of a master that is not rigid."""
    for k, item, contact in listed_passes(c.scene, c.model):
        if isinstance(contact.master, RigidPlane) or not item.leads or contact.master.body in c.scene.rigid_names:
            continue
        if item.bonds is not None or _few_nodes(c, k, PATCH):  # they do not tell how wide the pressed place is
            continue
        patch, width = _pressed(c.model, item, c.ledger.nodes_at_peak(k), c.depths[k])
        if patch < least * width**2:
            yield dict(slave=contact.slave.body, patch=math.sqrt(patch), master=contact.master.body, width=width)


@row(
    "{slave} lies around or in {master} without friction: only their facets keep them from turning against each other, "
    "and the fit is lost where they turn by half a facet;",
    "give the contact mu, or hold both bodies against turning",
    0.5,
    "of the size of the normals is left in their mean at most, where one body surrounds the other",
    kind=Kind.ADVICE,
    when=When.BEFORE,
)
def frictionless_fit(c: Context, most: float) -> Iterator[Values]:
    """Size of the mean of unit normals where curved surfaces of a contact without friction lie on each other."""
    from scipy.spatial import KDTree

    for _, item, contact in listed_passes(c.scene, c.model):
        if isinstance(contact.master, RigidPlane) or not item.leads or item.mu > 0.0 or item.friction or item.bonds:
            continue
        if not item.curved:
            continue
        area, normal = face_geometry(c.model.X, item.face)
        middle, X = c.model.X[item.face].mean(axis=1), c.model.X[item.slave]
        face = np.asarray(KDTree(middle).query(X)[1])
        unit = normal[face] / area[face, None]
        close = np.abs(((X - middle[face]) * unit).sum(axis=1)) < FLUSH * np.sqrt(area[face])
        if close.mean() > 0.5 and np.linalg.norm(unit[close].mean(axis=0)) < most:
            yield dict(slave=contact.slave.body, master=contact.master.body)


def on_edges(c: Context, k: int, depths: Sequence[Array]) -> bool:
    """Whether edges or corners bear contact k: no face of its slaves is pressed at all its corners.

    Nothing is said of surfaces that change as elements fail.

    Args:
        c: scene and model.
        k: number of the contact.
        depths: of each contact pass, largest penetration of each spring [m], shape (spring_count,).
    """
    found = False
    for item, depth in zip(c.model.passes, depths, strict=True) if not c.scene.failing else ():
        if item.contact == k and len(item.slave) and depth.any():
            deep = depth.reshape(len(item.slave), -1).max(axis=1)
            pressed = item.slave[deep > PRESSED * deep.max()]
            if np.isin(item.slave_face, pressed).all(axis=1).any():
                return False
            found = True
    return found


def _few_nodes(c: Finished, k: int, patch: float) -> float:
    """Nodes that carried contact pass k at its greatest force, if these are few; else 0."""
    item = c.model.passes[k]
    if item.bonds is not None:
        return 0.0
    planes = sum(share > 0.0 for share in _held(c.model, item))
    # A plane of symmetry leaves half of the patch, and half of the force on nodes in it.
    count = c.ledger.nodes_at_peak(k) * math.sqrt(2.0) ** planes
    few = count < patch if item.curved else on_edges(c, item.contact, c.depths)
    return count if few else 0.0


def _pressed(model: Model, item: ContactPass, count: float, depth: Array) -> tuple[float, float]:
    """Area that a curved contact covers [m^2] and width of the master's faces there [m]; 1, 0 of a flat one.

    Args:
        model, item: one of its passes.
        count: nodes of the slave that carried the greatest force.
        depth: largest penetration of each spring [m], shape (spring_count,), those of slave 0 first.
    """
    from scipy.spatial import KDTree

    depth = depth.reshape(len(item.slave), -1).max(axis=1)
    touched = np.flatnonzero(depth > 0.5 * depth.max(initial=0.0))
    if not (len(touched) and item.curved):
        return 1.0, 0.0
    patch = count * float(np.mean([_area_around(model.X, item, node) for node in touched.tolist()]))
    area, _ = face_geometry(model.X, item.face)
    nearest = KDTree(model.X[item.face].mean(axis=1)).query(model.X[item.slave[touched]])[1]
    return patch, math.sqrt(float(np.median(area[nearest])))


def symmetry_of(model: Model) -> dict[int, Array]:
    """Normals of planes of symmetry through each contact [-], shape (plane_count, 3), by contact.

    A plane of symmetry holds some nodes of the slave along an axis, and leaves others free.
    """
    first = [item for item in model.passes if item.leads]
    return {item.contact: np.eye(3)[[0.0 < share < 1.0 for share in _held(model, item)]] for item in first}


def _held(model: Model, item: ContactPass) -> list[float]:
    """Share of a pass's slave nodes that are held along each axis [-]."""
    return [float((model.fixed_axes[item.slave] >> axis & 1).mean()) for axis in range(3)]


def _area_around(X: Array, item: ContactPass, node: int) -> float:
    """Area of the surface that belongs to a slave node [m^2]: an equal part of each face around it."""
    faces = item.slave_face[item.face_of_slave[item.slave_offset[node] : item.slave_offset[node + 1]]]
    corners = [len(np.unique(face)) for face in faces]
    return float((face_geometry(X, faces)[0] / corners).sum())


def _thickness(X: Array) -> float:
    """Least extent of nodes along their principal axes [m]."""
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
