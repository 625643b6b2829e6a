"""Owns what the laws of friction of a contact need: the areas of its slave nodes, and the parameters on each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.geometry.cell_types import is_triangle
from warp_mca.physics.contact.sides import find_sides
from warp_mca.scene import Contact, ContactAll
from warp_mca.scene.friction_laws import friction_parameters

if TYPE_CHECKING:
    from warp_mca.system.contact import ContactPass, Faces


def node_areas(slave: Faces) -> Array:
    """Area of each node of a surface [m^2], shape (node_count,), float64: a quarter, or third, of its faces around.

    At a sharp edge those of one side count, that on which the node has most: an edge presses with one of its sides.
    """
    nodes, side, triangle = slave.nodes, find_sides(slave.node, slave.normal), is_triangle(slave.node)
    share = slave.area / np.where(triangle, 3.0, 4.0)
    total = np.zeros((nodes[-1] + 1, side.max(initial=0) + 1))
    for corner in range(4):
        own = ~triangle if corner == 3 else slice(None)  # a triangle has its last corner twice
        np.add.at(total, (slave.node[own, corner], side[own]), share[own])
    return total[nodes].max(axis=1)


def friction_values(contact: Contact | ContactAll, slave: Faces) -> dict[str, Any]:
    """Modules of the laws of friction that a contact pass has, and their parameters; nothing where there are none.

    Raises:
        RequestError: a law is not what `FrictionLaw` describes.
    """
    laws = contact.friction_laws
    if not laws:
        return {}
    share = 0.5 if contact.two_way else 1.0  # as of the stiffness: either pass bears half
    area, place = np.unique(share * node_areas(slave), return_inverse=True)
    rows = [[friction_parameters(law, float(value)) for law in laws] for value in area]
    return {"friction": tuple(law.law for law in laws), "friction_parameters": _filled(rows)[place]}


def friction_rows(items: Sequence[ContactPass], sides: int) -> Array:
    """Parameters of all springs of a pass of each scene, shape (law_count spring_count, parameter_count), float64.

    Each slave node has a spring for each of the `sides` of the master.
    """
    width = max(item.friction_parameters.shape[2] for item in items)
    tables = [np.repeat(item.friction_parameters, sides, axis=0) for item in items]
    rows = [table.reshape(-1, table.shape[2]) for table in tables if table.size]
    return np.concatenate([np.zeros((0, width)), *(np.pad(r, ((0, 0), (0, width - r.shape[1]))) for r in rows)])


def _filled(rows: Sequence[Sequence[tuple[float, ...]]]) -> Array:
    """One array of rows of different lengths, with zeros behind the shorter ones."""
    width = max(len(values) for row in rows for values in row)
    return np.array([[(*values, *(0.0,) * (width - len(values))) for values in row] for row in rows])
