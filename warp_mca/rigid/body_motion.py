"""Owns the rigid motions that a body's constraints leave it, and the one that fits a nodal motion best.

Small rigid motions of a body about its centre of mass are J z with z = (translation, rotation). Held axes A (rows of J
at nodes that are fixed or driven) must move as their nodes do, A z = b: z = z_p + N y, N the null space of A. The rest
is fitted in the mass norm, N^T J^T m (w - J z) = 0 for a nodal field w, so the momenta N^T J^T m w are kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.rotation import rotation_matrix
from warp_mca.geometry.mesh import Mesh
from warp_mca.rigid.chain import Array
from warp_mca.rigid.placement import Placement
from warp_mca.scene import Scene

MAX_ITERATIONS = 50  # of the fit of a pose; elastic shapes need three or four
HELD = 1e-4  # least share of a rigid motion that shows at held nodes; less than that is the deformation of their shape


@dataclass(frozen=True, kw_only=True)
class Fit:
    """What a rigid motion that fits nodes best has, and what it leaves out.

    Attributes:
        kinetic_energy: of the rigid motion [J].
        vibration_energy: kinetic energy of the motion that is left over [J].
        drive_work: kinetic energy of the nodes and the carriage less these two [J]: the rigid motion has less because
            driven nodes and a driven base keep their velocity; 0 where they are at rest.
        momenta: generalised momenta J^T m V of the rigid motion and of the nodes, shape (2, free_count), float64: for
            the coordinates of a chain [kg m^2/s]; for what held axes leave free of a body's translations and rotations
            about its centre over the radius of inertia [kg m/s].
    """

    kinetic_energy: float
    vibration_energy: float
    drive_work: float
    momenta: Array


@dataclass(frozen=True, kw_only=True)
class BodyMotion(Fit):
    """The rigid motion of a body; its `placement` has the centre of mass as pivot."""

    placement: Placement


def held_axes(scene: Scene, meshes: Mapping[str, Mesh]) -> dict[str, NDArray[np.bool_]]:
    """Axes of nodes that `Fixed` and `Prescribed` hold, by body name, each shape (node_count, 3), bool."""
    held = {body.name: np.zeros((len(meshes[body.name].points), 3), dtype=bool) for body in scene.bodies}
    for item in scene.fixed:
        for letter in item.axes:
            held[item.body][meshes[item.body].nodes(item.nodes), "xyz".index(letter)] = True
    for item in scene.prescribed:
        held[item.body][meshes[item.body].nodes(item.nodes), "xyz".index(item.axis)] = True
    return held


def body_motion(
    points: Array, masses: Array, positions: Array, velocities: Array, held: NDArray[np.bool_] | None = None
) -> BodyMotion:
    """Fit a rigid pose and motion to the nodes of one body.

    Args:
        points: shape of the body in its frame, deformed or not [m], shape (node_count, 3), float64.
        masses: lumped nodal masses [kg], shape (node_count,), float64.
        positions: of the nodes in the world [m], shape (node_count, 3), float64.
        velocities: of the nodes [m/s], shape (node_count, 3), float64.
        held: axes of nodes that are fixed or driven, shape (node_count, 3), bool.
    """
    placement = _best_pose(points, masses, positions)
    held = np.zeros(points.shape, dtype=bool) if held is None else held
    for _ in range(MAX_ITERATIONS):
        motion = Motions(placement.place(points)[0], placement.origin, masses, held)
        step = motion.fit(positions - motion.shape)[0]
        rotation = rotation_matrix(step[3:]) @ placement.rotation
        placement = replace(placement, origin=placement.origin + step[:3], rotation=rotation)
        if max(np.abs(step[:3]).max() / motion.radius, np.abs(step[3:]).max()) <= 4.0 * np.finfo(np.float64).eps:
            break
    motion = Motions(placement.place(points)[0], placement.origin, masses, held)
    z, forced, free = motion.fit(velocities)
    placement = replace(placement, velocity=z[:3], angular_velocity=z[3:])
    V = placement.place(points)[1]
    left = velocities - V
    return BodyMotion(
        placement=placement,
        kinetic_energy=float(0.5 * masses @ (V**2).sum(axis=1)),
        vibration_energy=float(0.5 * masses @ (left**2).sum(axis=1)),
        drive_work=float(masses @ (motion.field(forced) * left).sum(axis=1)),
        momenta=np.stack([free.T @ motion.momenta(V), free.T @ motion.momenta(velocities)]),
    )


def _best_pose(points: Array, masses: Array, positions: Array) -> Placement:
    """The pose that fits a free body best (Kabsch, Acta Crystallographica A32, 1976), at rest."""
    pivot, origin = masses @ points / masses.sum(), masses @ positions / masses.sum()
    u, _, vt = np.linalg.svd((positions - origin).T @ (masses[:, None] * (points - pivot)))
    mirror = np.diag([1.0, 1.0, np.linalg.det(u @ vt)])
    none = np.zeros(3)
    return Placement(pivot=pivot, origin=origin, rotation=u @ mirror @ vt, velocity=none, angular_velocity=none)


class Motions:
    """Small rigid motions J of a shape about a centre, and those among them that held axes leave free.

    Attributes:
        shape: node positions [m], shape (node_count, 3), float64.
        radius: of inertia [m]; rotations count as speeds at that distance.
    """

    def __init__(self, shape: Array, centre: Array, masses: Array, held: NDArray[np.bool_]) -> None:
        self.shape, self._masses = shape, masses
        r = shape - centre
        self.radius = float(np.sqrt(masses @ (r**2).sum(axis=1) / masses.sum()))
        self._held = held
        turning = np.cross(np.eye(3)[None], (r / self.radius)[:, None])  # (node, axis of rotation, component)
        ways = np.broadcast_to(np.eye(3), (len(r), 3, 3))
        self._J = np.concatenate([ways, turning], axis=1).transpose(0, 2, 1)  # (node, component, motion)
        self._units = np.array([1.0] * 3 + [1.0 / self.radius] * 3)

    def field(self, z: Array) -> Array:
        """J z, shape (node_count, 3), of translation and rotation z."""
        return self._J @ (z / self._units)

    def momenta(self, field: Array) -> Array:
        """J^T m w, shape (6,), of a nodal field w, rotations over the radius."""
        return np.einsum("ncz,nc->z", self._J, self._masses[:, None] * field)

    def fit(self, field: Array) -> tuple[Array, Array, Array]:
        """Translation and rotation z that fit a nodal field best, the part z_p of it that held axes force, and N."""
        (u, size, vt), rank = self._held_motions
        known = np.concatenate([field[self._held], np.zeros(6)])
        forced, free = vt[:rank].T @ (u[:, :rank].T @ known / size[:rank]), vt[rank:].T
        mass = np.einsum("ncz,n,ncy->zy", self._J, self._masses, self._J, optimize=True)
        needed = self.momenta(field - self._J @ forced)
        z = forced + free @ np.linalg.solve(free.T @ mass @ free, free.T @ needed)
        return z * self._units, forced * self._units, free

    def free(self) -> Array:
        """J N, shape (node_count, 3, free_count): the nodal fields of the motions that held axes leave free."""
        (_, _, vt), rank = self._held_motions
        return self._J @ vt[rank:].T

    @cached_property
    def _held_motions(self) -> tuple[tuple[Array, Array, Array], int]:
        """Singular value decomposition of A, and its rank."""
        rows = np.concatenate([self._J[self._held], np.zeros((6, 6))])  # so that all of the null space is found
        u, size, vt = np.linalg.svd(rows, full_matrices=False)
        return (u, size, vt), int((size > HELD * size[0]).sum()) if size[0] > 0.0 else 0
