"""Owns the axes along which the forces of a contact are reported."""

from __future__ import annotations

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.scene import Contact, RigidPlane
from warp_mca.system.contact import Faces

CLOSED = 1e-6  # share of a surface's area below which its normals cancel
PARALLEL = 1e-6  # sine of the angle between directions that count as one
NEAR_Z = 0.342  # sine of the angle from the z axis, below which tangents are not taken along n x z
_SAMPLES = np.array([0.125, 0.375, 0.625, 0.875])  # along both edges of a face, where its distance is taken


def contact_axes(X: Array, contact: Contact, slave: Faces, master: Faces | None) -> tuple[Array, Array]:
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
