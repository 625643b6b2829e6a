"""Owns the check that no body can pass between the slave nodes of a contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.scene import RigidPlane

if TYPE_CHECKING:
    from warp_mca.model.surfaces import Faces
    from warp_mca.scene import Contact

Array = NDArray[np.float64]

FACING = 0.1  # cosine between a face's normal and the direction of approach from which on the face may strike


def check_spacing(contact: Contact, X: Array, V: Array, slave: Faces, master: Faces | None) -> None:
    """Raise RequestError if bodies can pass between slave nodes: only nodes are kept out of the master.

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
