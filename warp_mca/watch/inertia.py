"""Owns the row about bodies that turn with more inertia than their shape has, as coarse meshes give.

A cell's mass lies in its corners: n cells along each edge of a brick have a moment of inertia 2 / n^2 above that of
its volume. What matters is the axis about which a body turns, and what else moves with it: in a link that turns about
a hinge at its end, three quarters of the inertia are those of its mass centre, which is exact.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from warp_mca.base.chunks import CHUNK, chunks
from warp_mca.base.rotation import mean_pose
from warp_mca.geometry import hexahedron, tetra10, tetrahedron
from warp_mca.geometry.cell_types import CELL_TYPES, HEXAHEDRON, TETRA10, linear_type
from warp_mca.geometry.hexahedron import CORNERS, shape_functions
from warp_mca.geometry.quality import volumes
from warp_mca.geometry.shape_volume import of_cells
from warp_mca.physics.elements.cells import body_cells, densities
from warp_mca.rigid.body_motion import held_axes
from warp_mca.system.bodies import GROUND
from warp_mca.watch.row import Array, Finished, Values, row

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.scene import Body
    from warp_mca.system.model import Model

TURNING = 1e-2  # energy of the rotation over twice that of the motion, below which inertia does not matter
ROCKING = 1e-3  # the same over weight times size: bodies at rest rock on their contact springs
HELD = 1e-6  # eigenvalue of what holds a body over the greatest, up to which a motion is free

_AT_GAUSS = shape_functions(CORNERS / np.sqrt(3.0))[0]  # shape (8 points, 8 corners)


class Motion(NamedTuple):
    """Rigid motion with the momentum and angular momentum of a body's nodes.

    Attributes:
        centre: of mass [m], shape (3,). velocity: of it [m/s], shape (3,). rate: angular velocity [rad/s], shape (3,).
        mass: [kg].
        inertia: about the centre [kg m^2], shape (3, 3).
    """

    centre: Array
    velocity: Array
    rate: Array
    mass: float
    inertia: Array

    @property
    def rotation_energy(self) -> float:
        """Twice that of the rotation [J]."""
        return float(self.rate @ self.inertia @ self.rate)


@row(
    "{body} turns, and the moment of inertia of its nodes is {excess:.1%} above that of its shape, since the mass of "
    "each cell lies in its corners:",
    "give it more cells",
    0.02,
    "of it at most: periods and times are off by half of it",
)
def raised_inertia(c: Finished, most: float) -> Iterator[Values]:
    """Moment of inertia of each body that turns at the start or the end; absorbing ones are parts of others."""
    if c.stopped:
        return
    model, absorbing = c.model, {item.body for item in c.scene.absorbing}
    for body in c.scene.bodies:
        if body.name in absorbing or body.mass is not None:
            continue
        mesh, own = c.meshes[body.name], c.nodes(body.name)
        mass = model.mass[own]
        begin, end = (_motion(x[own], w[own], mass) for x, w in ((model.X, model.V), (model.X + c.u, c.v)))
        first, last = (float(mass @ (w[own] ** 2).sum(axis=1)) for w in (model.V, c.v))
        weight = float(np.linalg.norm(model.gravity[0])) * begin.mass * float(np.ptp(mesh.points, axis=0).max())
        still = max(TURNING * first, ROCKING * weight)
        turns = []
        for motion, x, energy in ((begin, model.X, first), (end, model.X + c.u, last)):
            moved = _allowed(c, body.name, x, motion)
            if moved.rotation_energy > max(still, TURNING * energy):
                turns.append((moved, x))
        turns = [(motion, x) for motion, x in turns if _most(motion, mesh) > most]
        if not turns:
            continue
        known = inertias(body, mesh)
        if (excess := max(_excess(known, mesh, model, own, *turn) for turn in turns)) > most:
            yield dict(body=f"{'rigid ' if body.rigid else ''}body {body.name}", excess=excess)


def inertias(body: Body, mesh: Mesh) -> tuple[Array, Array]:
    """Inertia about the mass centre of a body's shape, and of its nodes [kg m^2], each shape (3, 3), in its own frame.

    J = tr(S) I - S with S = integral of rho x x^T; lumping keeps mass and centre, so that S alone differs. What the
    cells leave out of a round shape lies at their skin: of the same mass, the share 1 - 1 / r is a shell there, r the
    shape's volume over that of the cells.
    """
    rho = densities(body, mesh)
    mass, first, exact, lumped = 0.0, np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
    middle = mesh.points.mean(axis=0)
    for cells in body_cells(body, mesh):
        for part in chunks(len(cells.conn), CHUNK):
            x, density = mesh.points[cells.conn[part]] - middle, rho[cells.index[part]]
            place, weight = _points(x, cells.element.cell)
            weight = weight * density[:, None]
            mass += weight.sum()
            first += weight.ravel() @ place.reshape(-1, 3)
            exact += _square(place, weight)
            lumped += _square(x, cells.element.lumped_masses(x, density))
    centred = np.outer(first, first) / mass
    plain = rho / of_cells(mesh) if body.exact_mass else rho
    own = plain * volumes(mesh)
    missing = 1.0 - float(own.sum() / (own @ of_cells(mesh)))
    shape = exact - centred
    if missing:
        shape = (1.0 - missing) * shape + missing * mass * _skin(mesh, middle + first / mass)
    return _inertia(shape), _inertia(lumped - centred)


def _skin(mesh: Mesh, centre: Array) -> Array:
    """Mean of x x^T over the skin of a mesh [m^2], shape (3, 3), with x from a centre [m]."""
    faces = mesh.boundary[0]
    a, b, c, d = np.moveaxis(mesh.points[faces] - centre, 1, 0)
    area = np.linalg.norm(np.cross(c - a, d - b), axis=1)
    triangle = (faces[:, 2] == faces[:, 3])[:, None]
    middle = np.where(triangle, (a + b + c) / 3.0, (a + b + c + d) / 4.0)
    return np.einsum("f,fi,fj->ij", area, middle, middle) / area.sum()


def _most(motion: Motion, mesh: Mesh) -> float:
    """Bound of the share by which lumping raises the inertia about the axis of a motion, from the largest cell [-].

    The mass m of a cell lies within half its diagonal d of its centre, so that its corners raise the inertia by no more
    than m d^2 / 4.
    """
    diagonal = np.zeros(3)
    for conn in filter(len, mesh.cells.values()):
        for axis, coordinate in enumerate(mesh.points.T):
            diagonal[axis] = max(diagonal[axis], np.ptp(coordinate[conn], axis=1).max())
    raised = 0.25 * motion.mass * float(diagonal @ diagonal)
    exact = motion.rotation_energy / float(motion.rate @ motion.rate) - raised
    return raised / exact if exact > 0.0 else np.inf


def _excess(known: tuple[Array, Array], mesh: Mesh, model: Model, own: slice, motion: Motion, x: Array) -> float:
    """Share by which lumping raises the inertia about the axis of a motion, at nodes x [m] of the model [-].

    A body that joints hold turns about the nearest of them; `known` as of `inertias`.
    """
    volume, nodes = known
    axis = mean_pose(mesh.points, x[own], model.mass[own])[2].T @ motion.rate
    axis /= np.linalg.norm(axis)
    away = np.cross(motion.velocity, motion.rate) / (motion.rate @ motion.rate)  # of the centre from a fixed axis
    bound = [(model.joint_first[j.start : j.end], model.joint_second[j.start : j.end]) for j in model.joints]
    bound.append((model.ties.slave, model.ties.master[:, 0]))
    arms = []
    for first, second in bound:
        mine = [(side >= own.start) & (side < own.stop) for side in (first, second)]
        at = np.concatenate([first[mine[0] & ~mine[1]], second[mine[1] & ~mine[0]]])
        if len(at):
            offset = np.cross(x[at].mean(axis=0) - motion.centre, motion.rate / np.linalg.norm(motion.rate))
            arms.append(float(np.linalg.norm(offset)))
    arm = max(float(np.linalg.norm(away)), min(arms, default=0.0))
    return float(axis @ (nodes - volume) @ axis / (axis @ volume @ axis + motion.mass * arm**2))


def _motion(x: Array, v: Array, mass: Array) -> Motion:
    total = float(mass.sum())
    centre, velocity = mass @ x / total, mass @ v / total
    arms = x - centre
    inertia = _inertia(_square(arms, mass))
    moment = (arms * mass[:, None]).T @ (v - velocity)  # sum of m r_i v_j
    spin = np.array([moment[1, 2] - moment[2, 1], moment[2, 0] - moment[0, 2], moment[0, 1] - moment[1, 0]])
    rate = np.linalg.lstsq(inertia, spin, rcond=None)[0].astype(np.float64)
    return Motion(centre, velocity, rate, total, inertia)


def _allowed(c: Finished, body: str, x: Array, motion: Motion) -> Motion:
    """The part of a motion that fixed and driven nodes, and those tied to the ground, leave free, at nodes x [m].

    Its velocity is the least with which the body can turn at that rate: that of a fixed axis away from the centre.
    """
    model, own = c.model, c.nodes(body)
    held = held_axes(c.scene, c.meshes)[body][:, :, None] * np.eye(3)
    tied = (model.joint_second == GROUND) & (model.joint_first >= own.start) & (model.joint_first < own.stop)
    np.add.at(held, model.joint_first[tied] - own.start, model.joint_tied[tied])
    some = np.flatnonzero(held.any(axis=(1, 2)))
    if not len(some):
        return motion._replace(velocity=np.zeros(3))
    size = float(np.sqrt(np.trace(motion.inertia) / motion.mass))
    arms = (x[own][some] - motion.centre) / size
    turning = np.array([np.cross(axis, arms) for axis in np.eye(3)])  # velocity of each node at a unit rate
    moves = np.concatenate([np.broadcast_to(np.eye(3)[:, None], turning.shape), turning])
    value, mode = np.linalg.eigh(np.einsum("ank,nkl,bnl->ab", moves, held[some], moves))
    free = mode[:, value <= HELD * value[-1]]
    part = free @ (free.T @ np.concatenate([motion.velocity, size * motion.rate]))
    _, share, turned = np.linalg.svd(free[3:], full_matrices=True)
    shift = free[:3] @ turned[(share > HELD).sum() :].T  # motions of the centre without rotation
    velocity = part[:3] - shift @ np.linalg.lstsq(shift, part[:3], rcond=None)[0] if shift.size else part[:3]
    return motion._replace(velocity=velocity, rate=part[3:] / size)


def _square(x: Array, weight: Array) -> Array:
    """Sum of weight x x^T over all points, shape (3, 3); x has shape (..., 3), weight (...)."""
    return (x * weight[..., None]).reshape(-1, 3).T @ x.reshape(-1, 3)


def _inertia(square: Array) -> Array:
    return np.trace(square) * np.eye(3) - square


def _points(x: Array, cell: str) -> tuple[Array, Array]:
    """Integration points [m] and weights [m^3] of cells with nodes x, exact for squares in bricks and tetrahedra."""
    if cell == TETRA10.name:
        return tetra10.shape_functions(tetra10.POINTS) @ x, tetra10.determinants(x)
    if (stored := linear_type(CELL_TYPES[cell].stored_as)) is HEXAHEDRON:
        corners = x[:, CELL_TYPES[cell].stored_corners]  # of wedges, some coincide
        return _AT_GAUSS @ corners, hexahedron.determinants(corners)
    corners = x[:, : stored.corners]
    return tetra10.POINTS @ corners, np.repeat(tetrahedron.volumes(corners)[:, None] / 4.0, 4, axis=1)
