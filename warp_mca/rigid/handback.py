"""Owns the way back: nodal motion after the last separation becomes the motion of rigid links again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from warp_mca.rigid.chain import Array, Chain, link_axes, mesh_link, perpendicular
from warp_mca.rigid.placement import link_placements

MAX_ITERATIONS = 50  # of the fit of the angles; elastic shapes need three or four


@dataclass(frozen=True, kw_only=True)
class HandBack:
    """Rigid motion that fits the nodes best, and what it leaves out.

    Attributes:
        theta: angles of the links [rad], shape (link_count,), float64.
        theta_dot: angular velocities of the links [rad/s], shape (link_count,), float64.
        kinetic_energy: of the rigid motion [J].
        vibration_energy: kinetic energy of the motion that is left over [J]; both add up to that of the nodes.
        shape_misfit: largest distance of a node from the rigid shape [m].
    """

    theta: Array
    theta_dot: Array
    kinetic_energy: float
    vibration_energy: float
    shape_misfit: float


def hand_back(
    chain: Chain,
    points: Mapping[str, Array],
    nodal_masses: Mapping[str, Array],
    positions: Mapping[str, Array],
    velocities: Mapping[str, Array],
    *,
    near: Array | None = None,
) -> HandBack:
    """Project nodal positions and velocities on the rigid motions of a chain, in the mass norm.

    With J = d(rigid positions)/d(theta), the angles solve J^T m (X - X_rigid(theta)) = 0 (Gauss-Newton from each
    link's own best rotation) and the rates solve (J^T m J) theta_dot = J^T m V; hinges stay closed and the ground hinge
    stays where it is. J^T m J is the chain's mass matrix with the nodes' own mass, centre and inertia.

    Args:
        chain: gives the order of the links, their hinges and the ground hinge; its masses are not used.
        points: node positions in the body's frame by body name [m], each shape (node_count, 3), float64.
        nodal_masses: lumped masses by body name [kg], each shape (node_count,), float64.
        positions: world positions by body name [m], each shape (node_count, 3), float64.
        velocities: world velocities by body name [m/s], each shape (node_count, 3), float64.
        near: angles that the result is to lie within half a turn of [rad], shape (link_count,); 0 by default.
    """
    links = [
        mesh_link(k.body, points[k.body], nodal_masses[k.body], hinge_out=k.hinge_out, hinge_in=k.hinge_in)
        for k in chain.links
    ]
    chain = replace(chain, links=tuple(links))
    names = [link.body for link in links]
    theta = np.array([_own_angle(points[name], nodal_masses[name], positions[name]) for name in names])
    near = np.zeros(len(names)) if near is None else np.asarray(near, dtype=np.float64)
    theta = near + np.remainder(theta - near + np.pi, 2.0 * np.pi) - np.pi
    rest = np.zeros(len(names))
    for _ in range(MAX_ITERATIONS):
        shape, _ = _rigid_nodes(chain, theta, rest, points)
        off = {name: positions[name] - shape[name] for name in names}
        change = _project(chain, theta, points, nodal_masses, off)
        theta = theta + change
        if np.abs(change).max() <= 4.0 * np.finfo(np.float64).eps:
            break
    theta_dot = _project(chain, theta, points, nodal_masses, velocities)
    shape, motion = _rigid_nodes(chain, theta, theta_dot, points)
    left = sum(nodal_masses[name] @ ((velocities[name] - motion[name]) ** 2).sum(axis=1) for name in names)
    return HandBack(
        theta=theta,
        theta_dot=theta_dot,
        kinetic_energy=chain.kinetic_energy(theta, theta_dot),
        vibration_energy=float(0.5 * left),
        shape_misfit=float(max(np.linalg.norm(positions[name] - shape[name], axis=1).max() for name in names)),
    )


def _own_angle(points: Array, masses: Array, positions: Array) -> float:
    """Angle of the rotation that fits one body best, hinges aside [rad]: tan alpha = sum m u x x / sum m u . x."""
    u = points[:, :2] - masses @ points[:, :2] / masses.sum()
    x = positions[:, :2] - masses @ positions[:, :2] / masses.sum()
    alpha = np.arctan2(masses @ (perpendicular(u) * x).sum(axis=1), masses @ (u * x).sum(axis=1))
    return -float(alpha) - 0.5 * np.pi


def _rigid_nodes(chain: Chain, theta: Array, theta_dot: Array, points: Mapping[str, Array]) -> tuple[dict, dict]:
    placed = {name: p.place(points[name]) for name, p in link_placements(chain, theta, theta_dot).items()}
    return {name: X for name, (X, _) in placed.items()}, {name: V for name, (_, V) in placed.items()}


def _project(
    chain: Chain,
    theta: Array,
    points: Mapping[str, Array],
    nodal_masses: Mapping[str, Array],
    field: Mapping[str, Array],
) -> Array:
    """(J^T m J)^-1 J^T m w for a nodal field w, shape (link_count,), float64.

    Row j of J turns the nodes of link j about their inbound hinge, d X / d theta_j = -z x R_j u, and moves all nodes
    beyond with the outbound hinge, -z x R_j h_j.
    """
    d, f = link_axes(theta)
    right, beyond = np.zeros(len(theta)), np.zeros(2)
    for j in reversed(range(len(theta))):
        link = chain.links[j]
        u = points[link.body][:, :2] - np.asarray(link.hinge_in)
        weighted = nodal_masses[link.body][:, None] * field[link.body][:, :2]
        arms = u[:, :1] * d[j] + u[:, 1:] * f[j]
        hinge = link.hinge_out[0] * d[j] + link.hinge_out[1] * f[j]
        right[j] = -(perpendicular(arms) * weighted).sum() - perpendicular(hinge) @ beyond
        beyond = beyond + weighted.sum(axis=0)
    return np.asarray(np.linalg.solve(chain.mass_matrix(theta), right), dtype=np.float64)
