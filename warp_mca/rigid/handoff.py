"""Owns the hand-off from rigid bodies to the nodes of their finite elements at contact."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from warp_mca.base.errors import bad_value
from warp_mca.base.kept import Kept
from warp_mca.base.rotation import rotation_matrix
from warp_mca.geometry.mesh import Mesh
from warp_mca.rigid.chain import Array, Chain
from warp_mca.rigid.placement import Placement, link_placements
from warp_mca.rigid.scene_chain import chain_from_scene, release
from warp_mca.rigid.swing import Swing, swing
from warp_mca.rigid.target import TargetPlane, target_plane, tip_gap
from warp_mca.scene import Body, RigidPhase, RigidPlane, Scene, Surface

_KEPT: Kept[bytes] = Kept(4_000_000)  # bytes of swings of this process


@dataclass(frozen=True, kw_only=True)
class Momenta:
    """What the hand-off must keep, summed over the links.

    Attributes:
        momentum: linear, x and y [kg m/s], shape (2,), float64.
        angular_momentum: about the ground hinge, z [kg m^2/s].
        kinetic_energy: [J].
    """

    momentum: Array
    angular_momentum: float
    kinetic_energy: float


@dataclass(frozen=True, kw_only=True)
class HandOff:
    """Initial state of the impact phase, and how it came about.

    Attributes:
        positions: world positions X of the nodes by body name [m], each shape (node_count, 3), float64.
        velocities: world velocities V of the nodes by body name [m/s], each shape (node_count, 3), float64.
        placements: rigid pose and motion of each body by name.
        t_contact: time of the first touch [s]; 0 without a rigid phase; None if nothing was touched by t_end.
        theta: coordinates of the chain (`Swing`), shape (coordinate_count,), float64; empty without a rigid phase.
        theta_dot: their rates, shape (coordinate_count,), float64; empty likewise.
        v_n: speed of the centre of the tip's sphere towards the target (downwards on a floor) [m/s]; None without.
        v_t: speed of that centre along the target in the xy plane (along +x on a floor) [m/s]; None without.
        contact_point: where the sphere touches the plane [m], shape (3,), float64; None without a touch, as v_n and
            v_t.
        energy_drift: largest error of the rigid phase's energy over its largest kinetic energy [-].
        rigid: momenta of the chain's rigid links at contact; None without a rigid phase.
        nodes: the same summed over the nodes of the links with their lumped masses; None without.
        momentum_mismatch: |difference| of the linear momenta over sum(m |V|) [-].
        angular_momentum_mismatch: |difference| of the angular momenta over sum(m |r| |V|) [-].
        energy_mismatch: |difference| of the kinetic energies over that of the nodes [-]. All three are round-off with
            inertia="mesh" and a few per cent with "slender".
        chain: the rigid links, with base and loads as at the release; None without a rigid phase.
        swing: the trajectory up to contact or t_end; None without.
        touch: the hand-off at the first touch of rigid links, of one at the release.
    """

    positions: dict[str, Array]
    velocities: dict[str, Array]
    placements: dict[str, Placement]
    t_contact: float | None = 0.0
    theta: Array
    theta_dot: Array
    v_n: float | None = None
    v_t: float | None = None
    contact_point: Array | None = None
    energy_drift: float = 0.0
    rigid: Momenta | None = None
    nodes: Momenta | None = None
    momentum_mismatch: float = 0.0
    angular_momentum_mismatch: float = 0.0
    energy_mismatch: float = 0.0
    chain: Chain | None = None
    swing: Swing | None = None
    touch: HandOff | None = None

    def angles(self, coordinates: Array) -> Array:
        """The links' part of `theta` or `theta_dot`, shape (link_count,)."""
        return coordinates if self.chain is None else self.chain.angles(coordinates)

    @property
    def slides(self) -> bool:
        """Whether the first of the coordinates is the way of a carriage."""
        return self.chain is not None and self.chain.slide is not None


def hand_off(
    scene: Scene, meshes: Mapping[str, Mesh], nodal_masses: Mapping[str, Array], *, t_end: float | None = None
) -> HandOff:
    """Place every body for the impact phase.

    Links take the exact rigid motion of the chain at contact. Other bodies move on with their own velocity and angular
    velocity during the swing; with `centre_target` the target's body is then moved along its plane until its frame's
    origin lies under the tip. Without a rigid phase all bodies take their own initial pose and motion.

    Args:
        scene: with or without a rigid phase.
        meshes: by body name, in the bodies' frames.
        nodal_masses: lumped masses by body name [kg], each shape (node_count,), float64.
        t_end: where the swing ends, touch or not [s]; by default it must touch by the rigid phase's t_max.

    Raises:
        RequestError: the joints form no planar chain, a link moves by itself, or the tip never reaches its target.
    """
    if scene.rigid is None:
        placements = {body.name: _own_placement(body, 0.0) for body in scene.bodies}
        positions, velocities = _place(placements, meshes)
        none = np.zeros(0)
        return HandOff(positions=positions, velocities=velocities, placements=placements, theta=none, theta_dot=none)
    chain = chain_from_scene(scene, meshes, nodal_masses)
    _check_bodies(scene, scene.rigid.target, chain)
    tip, plane = scene.rigid.tip, target_plane(scene, scene.rigid.target, meshes)
    run = _swung(chain, scene.rigid, plane, t_end)
    placed, touched = chain.moved_to(run.t_end), run.ended_by == "touch"
    placements = {body.name: _own_placement(body, run.t_end) for body in scene.bodies}
    placements |= link_placements(placed, run.theta, run.theta_dot)
    centre, velocity = (part[0] for part in placements[tip.body].place(np.array([tip.centre])))
    if touched and scene.rigid.centre_target and isinstance(scene.rigid.target, Surface):
        name = scene.rigid.target.body
        placements[name] = _move_under(placements[name], centre, plane.normal)
    positions, velocities = _place(placements, meshes)
    return HandOff(
        positions=positions,
        velocities=velocities,
        placements=placements,
        t_contact=run.t_end if touched else None,
        theta=run.theta,
        theta_dot=run.theta_dot,
        **(speeds(velocity, plane) if touched else {}),
        contact_point=centre - tip.radius * plane.normal if touched else None,
        energy_drift=run.energy_drift,
        **_balance(placed, run, positions, velocities, nodal_masses),
        chain=chain,
        swing=run,
    )


def _swung(chain: Chain, rigid: RigidPhase, plane: TargetPlane, t_end: float | None) -> Swing:
    """The swing of `hand_off`, computed once in a process for chains, releases and planes that are equal.

    It is kept packed, so that each run has arrays of its own.
    """
    start = release(rigid)
    try:
        key = pickle.dumps((chain, start, rigid.tip, plane, rigid.t_max, t_end))
    except Exception:  # loads from outside the package that cannot be packed
        return swing(chain, *start, tip_gap(chain, rigid.tip, plane), rigid.t_max, t_end=t_end)
    packed = _KEPT.get(key)
    if packed is None:
        packed = pickle.dumps(swing(chain, *start, tip_gap(chain, rigid.tip, plane), rigid.t_max, t_end=t_end))
        _KEPT.put(key, packed, len(packed))
    return pickle.loads(packed)


def at_release(scene: Scene, meshes: Mapping[str, Mesh], nodal_masses: Mapping[str, Array]) -> HandOff:
    """Place every body at the release, and say where rigid links will touch.

    The target's body lies where its motion takes it under the tip of rigid links, with `centre_target`.

    Returns:
        The scene at t = 0, with a chain of the mesh's inertia, and with the hand-off of that chain at its `touch`.

    Raises:
        RequestError: as in `hand_off`.
    """
    assert scene.rigid is not None
    rigid = replace(scene.rigid, inertia="mesh")
    touch = hand_off(replace(scene, rigid=rigid), meshes, nodal_masses)
    assert touch.chain is not None and touch.swing is not None
    placements = {body.name: _own_placement(body, 0.0) for body in scene.bodies}
    if isinstance(rigid.target, Surface):
        name = rigid.target.body
        moved = touch.placements[name].origin - _own_placement(scene.body(name), touch.swing.t_end).origin
        placements[name] = replace(placements[name], origin=placements[name].origin + moved)
    theta, theta_dot = touch.swing.theta_t[0], touch.swing.theta_dot_t[0]
    placements |= link_placements(touch.chain, theta, theta_dot)
    positions, velocities = _place(placements, meshes)
    return HandOff(
        positions=positions,
        velocities=velocities,
        placements=placements,
        theta=theta,
        theta_dot=theta_dot,
        chain=touch.chain,
        touch=touch,
    )


def _own_placement(body: Body, t: float) -> Placement:
    """Pose and motion of a free body after t [s] at its own velocity and angular velocity."""
    omega, velocity = np.array(body.angular_velocity), np.array(body.velocity)
    return Placement(
        pivot=np.zeros(3),
        origin=np.array(body.position) + velocity * t,
        rotation=rotation_matrix(omega * t) @ rotation_matrix(body.rotation),
        velocity=velocity,
        angular_velocity=omega,
    )


def _move_under(placement: Placement, centre: Array, normal: Array) -> Placement:
    """The placement moved along the plane until its frame's origin lies under `centre` [m]."""
    offset = centre - placement.origin
    origin = placement.origin + offset - (offset @ normal) * normal
    return Placement(**{**vars(placement), "origin": origin})


def _place(placements: Mapping[str, Placement], meshes: Mapping[str, Mesh]) -> tuple[dict, dict]:
    placed = {name: placement.place(meshes[name].points) for name, placement in placements.items()}
    return {name: X for name, (X, _) in placed.items()}, {name: V for name, (_, V) in placed.items()}


def _check_bodies(scene: Scene, target: Surface | RigidPlane, chain: Chain) -> None:
    names = [link.body for link in chain.links]
    for name in names:
        body = scene.body(name)
        for field in ("velocity", "angular_velocity"):
            if any(getattr(body, field)):
                remedy = "a link moves as RigidPhase.theta_dot says; leave this at 0"
                raise bad_value(f"Body {name}.{field}", getattr(body, field), remedy)
    if isinstance(target, Surface) and target.body in names:
        raise bad_value("RigidPhase.target.body", target.body, "the target must not be a link of the chain")


def speeds(velocity: Array, plane: TargetPlane) -> dict[str, float]:
    """Velocity of the tip [m/s] against the plane's normal n, `v_n`, and along (n_y, -n_x, 0), `v_t`."""
    n = plane.normal
    along = np.array([n[1], -n[0], 0.0]) / np.hypot(n[0], n[1])
    return {"v_n": float(-velocity @ n), "v_t": float(velocity @ along)}


def _balance(chain: Chain, run: Swing, X: Mapping, V: Mapping, nodal_masses: Mapping[str, Array]) -> dict:
    """Momenta of the rigid links and of their nodes, and how far they differ; neither has the carriage of a base."""
    names = [link.body for link in chain.links]
    m = np.concatenate([nodal_masses[name] for name in names])
    r = np.concatenate([X[name] for name in names])[:, :2] - np.asarray(chain.origin)
    v = np.concatenate([V[name] for name in names])[:, :2]
    base = chain.hinges(run.theta, run.theta_dot)[1][0]
    rigid = Momenta(
        momentum=chain.momentum(run.theta, run.theta_dot),
        angular_momentum=chain.angular_momentum(run.theta, run.theta_dot),
        kinetic_energy=chain.kinetic_energy(run.theta, run.theta_dot) - 0.5 * chain.carriage_mass * float(base @ base),
    )
    nodes = Momenta(
        momentum=m @ v,
        angular_momentum=float(m @ (r[:, 0] * v[:, 1] - r[:, 1] * v[:, 0])),
        kinetic_energy=float(0.5 * m @ (v**2).sum(axis=1)),
    )
    speed, tiny = np.linalg.norm(v, axis=1), np.finfo(np.float64).tiny
    return {
        "rigid": rigid,
        "nodes": nodes,
        "momentum_mismatch": float(np.linalg.norm(nodes.momentum - rigid.momentum) / max(m @ speed, tiny)),
        "angular_momentum_mismatch": abs(nodes.angular_momentum - rigid.angular_momentum)
        / max(float(m @ (np.linalg.norm(r, axis=1) * speed)), tiny),
        "energy_mismatch": abs(nodes.kinetic_energy - rigid.kinetic_energy) / max(nodes.kinetic_energy, tiny),
    }
