"""Owns the mechanics of a planar chain of rigid links: mass matrix, forces, energy, momentum, reactions.

Angles follow `RigidPhase`: a link at theta has its frame's x axis along d = (-sin theta, -cos theta) and its y axis
along f = (cos theta, -sin theta), d turned by +90 degrees about +z. A growing theta turns the link clockwise:
omega_z = -theta_dot. With u_i, w_i the hinge vector and the first moment of link i in the world, Lagrange's equations

    M(theta) theta'' + C(theta, theta') + G(theta) = 0

generalise Eq. (5) of the paper to n links with any centre of mass and hinge:

    M_ij = u_i . w_j (i < j),  M_ii = I_i + m_i |c_i|^2 + m_(>i) |h_i|^2,  w_i = R_i (m_i c_i + m_(>i) h_i)
    C_j  = sum_(i<j) (u_i . z x w_j) theta_i'^2 - sum_(i>j) (u_j . z x w_i) theta_i'^2,  G_j = g . z x w_j

With a base that slides along e by s, s comes in front of the angles; m is the mass of all links and the carriage:

    M_ss = m,  M_sj = -e . z x w_j,  C_s = -sum_j (e . w_j) theta_j'^2,  G_s = -m g . e
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from warp_mca.rigid.link import Array, Link, Vec2
from warp_mca.rigid.loads import Loads


def perpendicular(vectors: Array) -> Array:
    """z x v for planar vectors v, shape (..., 2), float64: a turn by +90 degrees about +z."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def link_axes(theta: Array) -> tuple[Array, Array]:
    """World directions d, f of the links' x and y axes [-], each shape (..., 2), float64, for theta (...,) [rad]."""
    sine, cosine = np.sin(theta), np.cos(theta)
    return np.stack([-sine, -cosine], axis=-1), np.stack([cosine, -sine], axis=-1)


@dataclass(frozen=True)
class Chain:
    """Rigid links, each hinged to the one before it and the first to the base: the ground, or a carriage on a rail.

    Every `theta`, `theta_dot` below holds the coordinates of the chain and their rates, float64, of shape
    (coordinate_count,): the angles of the links [rad, rad/s], with the carriage's way s [m, m/s] in front where the
    base slides. Positions and velocities are those in the world at the time for which `origin` and `origin_velocity`
    hold; `moved_to` gives them at another time.

    Attributes:
        links: from the base outwards.
        origin: world position of the ground hinge at s = 0 [m].
        gravity: [m/s^2].
        slide: unit vector along which the base slides [-]; None if it does not.
        carriage_mass: of the carriage that carries the first hinge [kg].
        origin_velocity: velocity of `origin` [m/s].
        loads: what acts besides gravity, or None.
    """

    links: tuple[Link, ...]
    origin: Vec2 = (0.0, 0.0)
    gravity: Vec2 = (0.0, -9.8)
    slide: Vec2 | None = None
    carriage_mass: float = 0.0
    origin_velocity: Vec2 = (0.0, 0.0)
    loads: Loads | None = None

    @property
    def coordinate_count(self) -> int:
        """Number of links, and one more where the base slides."""
        return len(self.links) + (self.slide is not None)

    def angles(self, coordinates: Array) -> Array:
        """The links' part of `theta` or `theta_dot`, shape (..., link_count)."""
        return coordinates if self.slide is None else coordinates[..., 1:]

    def moved_to(self, t: float) -> Chain:
        """The chain with its ground hinge where the base's table has it at time t [s from release]; else itself."""
        if self.loads is None or self.loads.base_velocity is None:
            return self
        table = self.loads.base_velocity
        shift, velocity = table.integral(t), table.at(t)
        origin = (float(self.origin[0] + shift[0]), float(self.origin[1] + shift[1]))
        return replace(self, origin=origin, origin_velocity=(float(velocity[0]), float(velocity[1])))

    @cached_property
    def _hinge_out(self) -> Array:
        return np.array([link.hinge_out for link in self.links], dtype=np.float64)

    @cached_property
    def _mass(self) -> Array:
        return np.array([link.mass for link in self.links])

    @cached_property
    def _centre(self) -> Array:
        return np.array([link.centre for link in self.links], dtype=np.float64)

    @cached_property
    def moments(self) -> tuple[Array, Array]:
        """First moment [kg m], shape (link_count, 2), and inertia about the inbound hinge [kg m^2] of each link, with
        the mass of all links beyond it put at its outbound hinge."""
        beyond = np.cumsum(self._mass[::-1])[::-1] - self._mass
        first = self._mass[:, None] * self._centre + beyond[:, None] * self._hinge_out
        own = np.array([link.inertia for link in self.links])
        second = own + self._mass * (self._centre**2).sum(axis=1) + beyond * (self._hinge_out**2).sum(axis=1)
        return first, second

    def _turn(self, theta: Array, vectors: Array) -> Array:
        d, f = link_axes(theta)
        return vectors[:, :1] * d + vectors[:, 1:] * f

    @cached_property
    def mass(self) -> float:
        """Of all links and the carriage [kg]."""
        return float(self._mass.sum()) + self.carriage_mass

    def mass_matrix(self, theta: Array) -> Array:
        """M(theta) [kg m^2], shape (coordinate_count, coordinate_count), float64; [kg m] and [kg] for s."""
        return self._mass_matrices(theta[None])[0]

    def _mass_matrices(self, theta: Array) -> Array:
        """Mass matrices of states, shape (count, coordinate_count, coordinate_count)."""
        theta = self.angles(theta)
        first, second = self.moments
        w = self._turn(theta, first)
        upper = np.triu(self._turn(theta, self._hinge_out) @ w.swapaxes(1, 2), 1)
        links = upper + upper.swapaxes(1, 2) + np.diag(second)
        if self.slide is None:
            return links
        coupling = (-perpendicular(w) @ np.asarray(self.slide))[:, None]
        top = np.concatenate([np.full((len(w), 1, 1), self.mass), coupling], axis=2)
        return np.concatenate([top, np.concatenate([coupling.swapaxes(1, 2), links], axis=2)], axis=1)

    def rate_force(self, theta: Array, theta_dot: Array) -> Array:
        """C(theta, theta_dot) [N m], shape (coordinate_count,), float64; [N] for s."""
        theta, theta_dot = self.angles(theta), self.angles(theta_dot)
        w = self._turn(theta, self.moments[0])
        upper = np.triu(self._turn(theta, self._hinge_out) @ perpendicular(w).T, 1)
        links = (upper.T - upper) @ theta_dot**2
        return links if self.slide is None else np.append(-(theta_dot**2) @ w @ np.asarray(self.slide), links)

    def gravity_force(self, theta: Array) -> Array:
        """G(theta) [N m], shape (coordinate_count,), float64; [N] for s."""
        if self.slide is None:
            return self._gravity_torques(theta)
        along = -self.mass * float(np.dot(self.gravity, self.slide))
        return np.append(along, self._gravity_torques(theta[1:]))

    def _gravity_torques(self, theta: Array) -> Array:
        return perpendicular(self._turn(theta, self.moments[0])) @ np.asarray(self.gravity)

    def acceleration(self, theta: Array, theta_dot: Array, force: Array | None = None) -> Array:
        """theta'' = M^-1 (Q - C - G) [rad/s^2], shape (coordinate_count,), float64, under a generalised force Q."""
        needed = self.rate_force(theta, theta_dot) + self.gravity_force(theta)
        needed = needed if force is None else needed - force
        return -np.asarray(np.linalg.solve(self.mass_matrix(theta), needed), dtype=np.float64)

    def kinetic_energy(self, theta: Array, theta_dot: Array) -> float:
        """T = theta' . M theta' / 2 [J], and v . p + m v^2 / 2 for a base that moves at v, p the momentum at v = 0."""
        relative = float(self.kinetic_energies(theta[None], theta_dot[None])[0])
        if not any(self.origin_velocity):
            return relative
        v = np.asarray(self.origin_velocity)
        return relative + float(v @ self._momentum(theta, theta_dot, self.mass)) - 0.5 * self.mass * float(v @ v)

    def kinetic_energies(self, theta: Array, theta_dot: Array) -> Array:
        """`kinetic_energy` of states of a chain whose base rests [J], shape (count,), float64.

        Args:
            theta, theta_dot: of each state, shape (count, coordinate_count).
        """
        return (0.5 * theta_dot[:, None] @ self._mass_matrices(theta) @ theta_dot[:, :, None])[:, 0, 0]

    def potential_energies(self, theta: Array) -> Array:
        """`potential_energy` of states [J], shape (count,), float64, for theta (count, coordinate_count)."""
        fixed = -self._turn(self.angles(theta), self.moments[0]).sum(axis=1) @ np.asarray(self.gravity)
        return (
            fixed if self.slide is None else fixed - self.mass * theta[:, 0] * float(np.dot(self.gravity, self.slide))
        )

    def potential_energy(self, theta: Array) -> float:
        """V = -g . (first moment of the chain about the ground hinge at s = 0) [J]."""
        return float(self.potential_energies(theta[None])[0])

    def hinges(self, theta: Array, theta_dot: Array) -> tuple[Array, Array]:
        """World positions [m] and velocities [m/s] of the inbound hinges, each shape (link_count, 2), float64.

        The arithmetic is that of `Placement.place`, so a node on a hinge lands on it without round-off.
        """
        arms = self._turn(self.angles(theta), self._hinge_out)
        turning = -self.angles(theta_dot)[:, None] * perpendicular(arms)
        positions = np.empty_like(arms)
        velocities = np.zeros_like(arms)
        positions[0], velocities[0] = self.origin, self.origin_velocity
        if self.slide is not None:
            positions[0] += theta[0] * np.asarray(self.slide)
            velocities[0] += theta_dot[0] * np.asarray(self.slide)
        for i in range(len(arms) - 1):
            positions[i + 1] = positions[i] + arms[i]
            velocities[i + 1] = velocities[i] + turning[i]
        return positions, velocities

    def at(self, index: int, point: Vec2, theta: Array, theta_dot: Array) -> tuple[Array, Array]:
        """World position [m] and velocity [m/s], each shape (2,), float64, of a point in the frame of link `index`."""
        positions, velocities = self.hinges(theta, theta_dot)
        d, f = link_axes(self.angles(theta)[index])
        arm = point[0] * d + point[1] * f
        return positions[index] + arm, velocities[index] - self.angles(theta_dot)[index] * perpendicular(arm)

    def momentum(self, theta: Array, theta_dot: Array) -> Array:
        """Linear momentum of the links [kg m/s], shape (2,), float64."""
        return self._momentum(theta, theta_dot, float(self._mass.sum()))

    def _momentum(self, theta: Array, theta_dot: Array, mass: float) -> Array:
        """Linear momentum [kg m/s] where `mass` [kg] moves with the first hinge and the links turn about it."""
        turning = -self.angles(theta_dot) @ perpendicular(self._turn(self.angles(theta), self.moments[0]))
        if self.slide is None and not any(self.origin_velocity):
            return turning
        slide = 0.0 if self.slide is None else theta_dot[0] * np.asarray(self.slide)
        return turning + mass * (np.asarray(self.origin_velocity) + slide)

    def angular_momentum(self, theta: Array, theta_dot: Array) -> float:
        """z component of the angular momentum of the links about `origin` [kg m^2/s]."""
        positions, velocities = self.hinges(theta, theta_dot)
        theta, theta_dot = self.angles(theta), self.angles(theta_dot)
        arms = self._turn(theta, self._centre)
        r = positions - np.asarray(self.origin) + arms
        v = velocities - theta_dot[:, None] * perpendicular(arms)
        spin = sum(link.inertia * -rate for link, rate in zip(self.links, theta_dot, strict=True))
        return float(self._mass @ (r[:, 0] * v[:, 1] - r[:, 1] * v[:, 0]) + spin)

    def base_force(self, theta: Array, theta_dot: Array, theta_ddot: Array) -> Array:
        """Force of the ground on the chain, carriage included [N], shape (2,), float64: p' - m g where the base rests.

        For a base that accelerates at a, pass a chain whose gravity is g - a.
        """
        w = self._turn(self.angles(theta), self.moments[0])
        force = -self.angles(theta_ddot) @ perpendicular(w) - self.angles(theta_dot) ** 2 @ w
        slide = 0.0 if self.slide is None else theta_ddot[0] * np.asarray(self.slide)
        return force + self.mass * (slide - np.asarray(self.gravity))
