"""Owns the way back: nodal motion after the last separation becomes the motion of rigid links and bodies again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.rotation import mean_pose, point_velocity
from warp_mca.rigid.body_motion import Fit, body_motion
from warp_mca.rigid.chain import Array, Chain, Vec2, link_axes, perpendicular
from warp_mca.rigid.link import mesh_link
from warp_mca.rigid.placement import Placement, link_placements
from warp_mca.scene.ties import Pin

MAX_ITERATIONS = 50  # of the fit of the angles; elastic shapes need three or four


@dataclass(frozen=True, kw_only=True)
class HandBack(Fit):
    """Rigid motion that fits the nodes best, and what it leaves out. Momenta of the chain come before those of bodies.

    Attributes:
        chain: the chain that was handed in, its links with mass, centre and inertia of the nodes in their `points`.
        theta: its coordinates (`Swing`), shape (coordinate_count,), float64.
        theta_dot: their rates, shape (coordinate_count,), float64.
        placements: rigid pose and motion of every body by name.
        displacements: of each node from the rigid shape, in its body's frame [m], by body name, each shape
            (node_count, 3), float64.
    """

    chain: Chain | None
    theta: Array
    theta_dot: Array
    placements: dict[str, Placement]
    displacements: dict[str, Array] = field(default_factory=dict)


def hand_back(
    chain: Chain | None,
    points: Mapping[str, Array],
    nodal_masses: Mapping[str, Array],
    positions: Mapping[str, Array],
    velocities: Mapping[str, Array],
    *,
    near: Array | None = None,
    held: Mapping[str, NDArray[np.bool_]] | None = None,
    t: float = 0.0,
    carriage: Vec2 = (0.0, 0.0),
) -> HandBack:
    """Project nodal positions and velocities on the rigid motions of a chain and of other bodies, in the mass norm.

    With J = d(rigid positions)/d(theta), the coordinates solve J^T m (X - X_rigid(theta)) = 0 (Gauss-Newton from each
    link's own best rotation) and the rates solve (J^T m J) theta_dot = J^T m (V - v_base); hinges stay closed and the
    base stays on its way. J^T m J is the chain's mass matrix with the nodes' own mass, centre and inertia. Bodies that
    are no links are fitted one by one (`body_motion`).

    Args:
        chain: gives the order of the links, their hinges, the base and its slide; its links' masses are not used. None
            if no body is a link.
        points: shape of each body in its frame by name, deformed or not [m], each shape (node_count, 3), float64.
        nodal_masses: lumped masses by body name [kg], each shape (node_count,), float64.
        positions: world positions by body name [m], each shape (node_count, 3), float64.
        velocities: world velocities by body name [m/s], each shape (node_count, 3), float64.
        near: angles that the result is to lie within half a turn of [rad], shape (link_count,); 0 by default.
        held: axes of nodes that are fixed or driven, by name of bodies that are no links (`held_axes`).
        t: time from release, for a base that moves [s].
        carriage: way [m] and velocity [m/s] of the carriage along the slide.
    """
    held = {} if held is None else held
    names = [] if chain is None else [link.body for link in chain.links]
    bodies = {
        name: body_motion(points[name], nodal_masses[name], positions[name], velocities[name], held.get(name))
        for name in points
        if name not in names
    }
    nodes = (points, nodal_masses, positions, velocities)
    fitted = None if chain is None else _fit_chain(chain, *nodes, near, t, carriage)
    parts: list[Fit] = [*([] if fitted is None else [fitted]), *bodies.values()]
    placements = {name: body.placement for name, body in bodies.items()} | (fitted.placements if fitted else {})
    return HandBack(
        chain=fitted.chain if fitted else None,
        theta=fitted.theta if fitted else np.zeros(0),
        theta_dot=fitted.theta_dot if fitted else np.zeros(0),
        placements=placements,
        kinetic_energy=sum(part.kinetic_energy for part in parts),
        vibration_energy=sum(part.vibration_energy for part in parts),
        drive_work=sum(part.drive_work for part in parts),
        displacements={name: placements[name].to_body(positions[name]) - points[name] for name in points},
        momenta=np.concatenate([part.momenta for part in parts], axis=1),
    )


def carriage_motion(
    chain: Chain, t: float, points: Array, masses: Array, positions: Array, velocities: Array, pin: Pin | None = None
) -> Vec2:
    """Way [m] and velocity [m/s] of the carriage along its slide, from the nodes that it carries; 0 without a slide.

    Args:
        chain: with base and slide as at the release.
        t: time from release [s].
        points: of the first link in its body's frame, without deformation [m], shape (node_count, 3), float64.
        masses: lumped masses of its nodes [kg], shape (node_count,), float64.
        positions, velocities: of its nodes in the world [m], [m/s], shape (node_count, 3), float64.
        pin: on the carriage, None where nodes on the axis are tied.
    """
    if chain.slide is None:
        return (0.0, 0.0)
    hinge, placed, e = np.asarray(chain.links[0].hinge_in), chain.moved_to(t), np.array(chain.slide)
    if pin is not None:
        point, weights = _carried(points, positions, masses, hinge, pin)
        velocity = point_velocity(positions, velocities, weights, point)
    else:
        on_axis = _on_axis(points, hinge)
        point, velocity = positions[on_axis].mean(axis=0), velocities[on_axis].mean(axis=0)
    way, rate = point[:2] - np.asarray(placed.origin), velocity[:2] - np.asarray(placed.origin_velocity)
    return (float(way @ e), float(rate @ e))


def _carried(points: Array, positions: Array, masses: Array, hinge: Array, pin: Pin) -> tuple[Array, Array]:
    """Where a pin's nodes carry a hinge along z [m], shape (3,), and their weights [kg], shape (node_count,)."""
    weights = masses * pin.weights(points, (float(hinge[0]), float(hinge[1]), 0.0), (0.0, 0.0, 1.0))
    centre, moved, R = mean_pose(points, positions, weights)
    return moved + R @ (np.append(hinge, centre[2]) - centre), weights


def deformed_chain(
    chain: Chain,
    reference: Mapping[str, Array],
    points: Mapping[str, Array],
    nodal_masses: Mapping[str, Array],
    pins: Sequence[Pin | None],
) -> Chain:
    """The chain with each hinge where its nodes have moved in their body's frame.

    Args:
        chain: whose hinges lie where they do in the reference shape.
        reference: shape of each link in its body's frame without deformation [m], each shape (node_count, 3), float64.
        points: the same, deformed.
        nodal_masses: lumped masses by body name [kg], each shape (node_count,), float64.
        pins: pin of each link's inbound hinge, None where it has none (`scene_chain.pins`).
    """
    links = []
    for k, link in enumerate(chain.links):
        nodes = reference[link.body], points[link.body], nodal_masses[link.body]
        ends = (("in", (0.0, 0.0), pins[k]), ("out", link.hinge_out, pins[k + 1] if k + 1 < len(pins) else None))
        shift = {end: _moved(*nodes, np.add(link.hinge_in, arm), pin) for end, arm, pin in ends}
        hinge_in, hinge_out = link.hinge_in + shift["in"], link.hinge_out + shift["out"] - shift["in"]
        links.append(replace(link, hinge_in=_pair(hinge_in), hinge_out=_pair(hinge_out)))
    return replace(chain, links=tuple(links))


def _pair(vector: Array) -> Vec2:
    return (float(vector[0]), float(vector[1]))


def _moved(reference: Array, points: Array, masses: Array, hinge: Array, pin: Pin | None) -> Array:
    """Mean displacement of the nodes on a hinge axis [m], shape (2,), float64; 0 if there are none.

    That of a pin is that of the axis which follows the mean motion of the nodes around it.
    """
    if pin is not None:
        return _carried(reference, points, masses, hinge, pin)[0][:2] - hinge
    on_axis = _on_axis(reference, hinge)
    return (points - reference)[on_axis, :2].mean(axis=0) if on_axis.any() else np.zeros(2)


def _on_axis(reference: Array, hinge: Array) -> NDArray[np.bool_]:
    """Which nodes lie on a hinge's axis."""
    return np.linalg.norm(reference[:, :2] - hinge, axis=1) <= 1e-6 * np.ptp(reference, axis=0).max()


def _fit_chain(
    chain: Chain,
    points: Mapping[str, Array],
    nodal_masses: Mapping[str, Array],
    positions: Mapping[str, Array],
    velocities: Mapping[str, Array],
    near: Array | None,
    t: float,
    carriage: Vec2,
) -> HandBack:
    """Coordinates and rates of the chain, as `hand_back` describes."""
    links = [
        mesh_link(k.body, points[k.body], nodal_masses[k.body], hinge_out=k.hinge_out, hinge_in=k.hinge_in)
        for k in chain.links
    ]
    chain = replace(chain, links=tuple(links))
    placed, names = chain.moved_to(t), [link.body for link in links]
    theta = np.array([_own_angle(points[name], nodal_masses[name], positions[name]) for name in names])
    near = np.zeros(len(names)) if near is None else np.asarray(near, dtype=np.float64)
    theta = near + np.remainder(theta - near + np.pi, 2.0 * np.pi) - np.pi
    theta = theta if chain.slide is None else np.append(carriage[0], theta)
    rest, moving = np.zeros(len(theta)), np.array([*placed.origin_velocity, 0.0])
    for _ in range(MAX_ITERATIONS):
        shape, _ = _rigid_nodes(placed, theta, rest, points)
        off = {name: positions[name] - shape[name] for name in names}
        change = _project(placed, theta, points, nodal_masses, off, carriage[0] - theta[0])[0]
        theta = theta + change
        if np.abs(change).max() <= 4.0 * np.finfo(np.float64).eps:
            break
    relative = {name: velocities[name] - moving for name in names}
    theta_dot, momenta = _project(placed, theta, points, nodal_masses, relative, carriage[1])
    _, motion = _rigid_nodes(placed, theta, theta_dot, points)
    rigid = {name: motion[name] - moving for name in names}
    left = {name: velocities[name] - motion[name] for name in names}
    energy = sum(nodal_masses[name] @ (left[name] ** 2).sum(axis=1) for name in names)
    forced = sum(nodal_masses[name] @ left[name] for name in names) @ moving
    if chain.slide is not None:
        slip = carriage[1] - theta_dot[0]
        energy += chain.carriage_mass * slip**2
        forced += chain.carriage_mass * slip * (moving[:2] @ np.asarray(chain.slide))
    return HandBack(
        chain=chain,
        theta=theta,
        theta_dot=theta_dot,
        placements=link_placements(placed, theta, theta_dot),
        kinetic_energy=placed.kinetic_energy(theta, theta_dot),
        vibration_energy=float(0.5 * energy),
        drive_work=float(forced),
        momenta=np.stack([_project(placed, theta, points, nodal_masses, rigid, theta_dot[0])[1], momenta]),
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
    motion: Mapping[str, Array],
    carriage: float,
) -> tuple[Array, Array]:
    """(J^T m J)^-1 J^T m w and J^T m w, shape (coordinate_count,), float64, for w of the nodes and of the carriage.

    Row j of J turns the nodes of link j about their inbound hinge, d X / d theta_j = -z x R_j u, and moves all nodes
    beyond with the outbound hinge, -z x R_j h_j; that of s moves all nodes and the carriage along the slide.
    """
    angles = chain.angles(theta)
    d, f = link_axes(angles)
    right, beyond = np.zeros(len(angles)), np.zeros(2)
    for j in reversed(range(len(angles))):
        link = chain.links[j]
        u = points[link.body][:, :2] - np.asarray(link.hinge_in)
        weighted = nodal_masses[link.body][:, None] * motion[link.body][:, :2]
        arms = u[:, :1] * d[j] + u[:, 1:] * f[j]
        hinge = link.hinge_out[0] * d[j] + link.hinge_out[1] * f[j]
        right[j] = -(perpendicular(arms) * weighted).sum() - perpendicular(hinge) @ beyond
        beyond = beyond + weighted.sum(axis=0)
    if chain.slide is not None:
        right = np.append(beyond @ np.asarray(chain.slide) + chain.carriage_mass * carriage, right)
    return np.asarray(np.linalg.solve(chain.mass_matrix(theta), right), dtype=np.float64), right
