"""Owns masses, centres and inertias of links: those of a file, of a mesh, and what the one has over the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine

SINGULAR = 1e-12  # least eigenvalue of a mass matrix with a diagonal of ones
SAME = 0.02  # share of mass and moments of inertia by which mesh and file of a link may differ and count as the same


@dataclass(frozen=True, kw_only=True)
class MassProperties:
    """Of a rigid body, in the frame of its link.

    Attributes:
        mass: [kg].
        centre: [m], shape (3,), float64.
        inertia: about the centre [kg m^2], shape (3, 3), float64.
    """

    mass: float
    centre: Array
    inertia: Array

    @property
    def about_origin(self) -> Array:
        """Inertia about the origin of the frame [kg m^2], shape (3, 3), float64."""
        return self.inertia + self.mass * spread(self.centre)

    @property
    def is_possible(self) -> bool:
        """Whether a body can have this inertia."""
        a, b, c = np.linalg.eigvalsh(self.inertia)
        return bool(a > 0.0 and a + b >= c * (1.0 - 1e-6))

    def less(self, other: MassProperties) -> MassProperties:
        """What remains when another one is taken away."""
        mass = self.mass - other.mass
        centre = (self.mass * self.centre - other.mass * other.centre) / mass
        inertia = self.about_origin - other.about_origin - mass * spread(centre)
        return MassProperties(mass=mass, centre=centre, inertia=0.5 * (inertia + inertia.T))

    def is_like(self, other: MassProperties) -> bool:
        """Whether another one is the same for all practical purposes: mass and inertia about this centre to SAME."""
        if abs(other.mass - self.mass) > SAME * self.mass:
            return False
        about = other.inertia + other.mass * spread(other.centre - self.centre)
        return float(np.abs(about - self.inertia).max()) <= SAME * float(np.trace(self.inertia))


def spread(r: Array) -> Array:
    """r . r I - r r^T [m^2], shape (3, 3), float64: the inertia about the origin of a unit mass at r [m]."""
    return r @ r * np.eye(3) - np.outer(r, r)


def of_nodes(points: Array, masses: Array) -> MassProperties:
    """Of point masses [kg], shape (count,), at `points` [m], shape (count, 3)."""
    mass = float(masses.sum())
    centre = masses @ points / mass
    r = points - centre
    moment = (masses[:, None] * r).T @ r
    return MassProperties(mass=mass, centre=centre, inertia=np.trace(moment) * np.eye(3) - moment)


def of_link(machine: Machine, link: int) -> MassProperties:
    """Of body `link` of the file."""
    model = machine.model
    axes = machine.matrix(model.body_iquat[link])
    inertia = axes @ np.diag(model.body_inertia[link]) @ axes.T
    return MassProperties(mass=float(model.body_mass[link]), centre=np.array(model.body_ipos[link]), inertia=inertia)


def rest_of(name: str, file: MassProperties, mesh: MassProperties) -> MassProperties | None:
    """What a link has over its mesh, and rides on it as a rigid body; None where they are alike.

    Raises:
        RequestError: it is no mass of a body, or the mesh lies elsewhere.
    """
    if file.is_like(mesh):
        return None
    if not _has_rest(file, mesh) and _has_rest(file, replace(mesh, centre=file.centre)):
        place, there = (", ".join(f"{x:.4g}" for x in item.centre) for item in (mesh, file))
        remedy = f"the file has that of the link at ({there}), in the link's frame, which meshes are given in; move it"
        raise bad_value(f"mass centre of the mesh of link {name} [m]", f"({place})", remedy)
    field = f"mass of the mesh of link {name} [kg]"
    if mesh.mass >= (1.0 - SAME) * file.mass:
        remedy = f"the file gives the link {file.mass:.6g} kg, and the mesh must not have more; change one of them"
        raise bad_value(field, round(mesh.mass, 9), remedy)
    rest = file.less(mesh)
    a, b, c = np.linalg.eigvalsh(rest.inertia)
    if not rest.is_possible:
        x, y, z = rest.centre
        remedy = (
            f"what the file has beyond it, {rest.mass:.4g} kg at ({x:.4g}, {y:.4g}, {z:.4g}) m, would have the "
            f"principal moments of inertia {a:.4g}, {b:.4g} and {c:.4g} kg m^2, which no body has, "
            f"with the mesh's mass centre {np.linalg.norm(mesh.centre - file.centre):.3g} m from that of the file; "
            "change mesh or file"
        )
        raise bad_value(field, round(mesh.mass, 9), remedy)
    return rest


def _has_rest(file: MassProperties, mesh: MassProperties) -> bool:
    """Whether `rest_of` has an answer."""
    return file.is_like(mesh) or (mesh.mass < (1.0 - SAME) * file.mass and file.less(mesh).is_possible)


def regular(machine: Machine) -> Array:
    """The mass matrix of a machine at its latest data, shape (nv, nv), float64.

    Raises:
        RequestError: some freedoms move nothing, or all the same.
    """
    M = machine.mass_matrix()
    scale = np.sqrt(np.maximum(np.diag(M), np.finfo(float).tiny))
    least, vectors = np.linalg.eigh(M / np.outer(scale, scale)) if len(M) else (np.ones(1), np.zeros((0, 1)))
    if least[0] < SINGULAR:
        moving = np.flatnonzero(np.abs(vectors[:, 0]) > 0.1)
        joints = dict.fromkeys(machine.names.joint(int(machine.model.dof_jntid[k])) for k in moving)
        remedy = "at the start they move nothing, or the same; leave one out, or start in another pose"
        raise bad_value("Robot: joints", ", ".join(joints), remedy)
    return M
