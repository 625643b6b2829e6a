"""Owns what rigid bodies allow as a time step: the springs that may press them at once, and how fast they may turn.

The scheme is of order 2: a body that turns by x in a step is off by x^2 / 6 of its angle, and a spring of frequency w
by (w dt)^2 / 24 of its phase. Both are held here; rows of the history have no part in it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.kernels.nodes.joint_arrays import ARMATURE, KP, LIMIT_STIFFNESS, STIFFNESS
from warp_mca.model.assembly import Assembly
from warp_mca.model.stable_step import BOUNCE, USUAL_SCALE
from warp_mca.physics.rigid.bodies import Rigid
from warp_mca.scene import Contact, RigidPlane, Scene
from warp_mca.system.bodies import GROUND
from warp_mca.system.body_joints import BodyJoint
from warp_mca.system.rigid import RigidBody
from warp_mca.system.time_step import StableStep

WHOLE = 100.0
ACCURATE = 400.0  # times that springs and servos of joints count: their phase is then off by some 3e-4
TURN = 0.01  # of a body in a step at most [rad]: its scheme is then off by some 1e-5 of the angle
LEAST_STEPS = 1000  # of a run without finite elements
ALIKE = 1e-9  # difference of moments of inertia, relative, below which they are the same


def bounce_factor(contact: Contact, scene: Scene) -> float:
    """How many times the springs of a contact count in the step: WHOLE of a rigid body on a plane or on a rigid one.

    All that its motion has then goes through springs alone. A spring that closes within a step makes or takes up to
    (omega dt)^2 of it.
    """
    alone = isinstance(contact.master, RigidPlane) or scene.body(contact.master.body).rigid
    return WHOLE if alone and scene.body(contact.slave.body).rigid else 1.0


def stable_with_rigid(parts: Assembly, rigid: Rigid, added: Array, velocity: Array) -> StableStep:
    """Stable step of a scene with rigid bodies.

    Each spring between a rigid body and another one counts half to either, see docs/theory.md: that of the other
    body is in the eigenvalues of its nodes. All springs of a rigid body may be closed at once; the largest
    eigenvalue of the body on them counts as that of springs that open and close.

    Args:
        parts: of the scene.
        rigid: its rigid bodies, one at least, and joints.
        added: what contact springs would add to the eigenvalue at each node [1/s^2], shape (node_count,), float64.
        velocity: initial velocities [m/s], shape (node_count, 3), float64.

    Raises:
        RequestError: as in `stable_step.stable_step`.
    """
    bodies = rigid.rigid_bodies
    own = np.concatenate([body.own for body in bodies])
    others = added.copy()
    others[own] = 0.0
    found = StableStep(dt=parts.scene.impact.duration / LEAST_STEPS, element=0, contact_share=0.0, shortened=1.0)
    if not parts.rigid.all():
        found = parts.stable(others)
    for place, body in enumerate(bodies):
        element = parts.element_start[body.name]
        worst = (2.0 * USUAL_SCALE) ** 2 / BOUNCE * _largest(body, parts.X, added[body.own] * parts.mass[body.own])
        if worst * found.dt**2 > 4.0:
            found = StableStep(dt=2.0 / math.sqrt(worst), element=element, contact_share=1.0, shortened=1.0)
        points = [row.point for row in rigid.rigid_rows if place in (row.first, row.second) and row.geared < 0]
        rate = likely_rate(body, parts.scene, _rate(body, parts, velocity), points)
        if rate * found.dt > TURN:
            found = replace(found, dt=TURN / rate, element=element, contact_share=0.0)
    stiffest, body = _stiffest(rigid)
    if stiffest * found.dt**2 > 4.0:
        element = parts.element_start[bodies[body].name]
        found = replace(found, dt=2.0 / math.sqrt(stiffest), element=element, contact_share=0.0)
    return found


def _stiffest(rigid: Rigid) -> tuple[float, int]:
    """Largest eigenvalue [1/s^2] of free rigid bodies on the springs of their joints, and a body that moves with it.

    Springs of limits count WHOLE times, others ACCURATE times. What joints hold moves less, and rotors make it slower;
    motions are those that couplers allow.
    """
    count = 6 * len(rigid.rigid_bodies)
    K, most = np.zeros((count, count)), (0.0, 0)
    for item in rigid.body_joints:
        k = ACCURATE * item.drive[:, [STIFFNESS, KP]].sum(axis=1) + WHOLE * item.drive[:, LIMIT_STIFFNESS]
        for row, stiffness, A in zip(_gradients(rigid, item), k, item.drive[:, ARMATURE], strict=True):
            K += stiffness / (1.0 + A * (row @ row)) * np.outer(row, row)
    if K.any():
        allowed = _allowed(rigid, count)
        values, vectors = np.linalg.eigh(allowed.T @ K @ allowed)
        most = float(values[-1]), int(np.abs(allowed @ vectors[:, -1]).argmax()) // 6
    return most


def _gradients(rigid: Rigid, joint: BodyJoint) -> Array:
    """Rates of a joint over momenta of unit energy of all bodies, shape (rate_count, 6 body_count), float64."""
    screws = np.linalg.pinv(joint.screws()).T
    found = np.zeros((len(screws), 6 * len(rigid.rigid_bodies)))
    for row, F in zip(found, screws, strict=True):
        for b, sign in ((joint.body, 1.0), (joint.other, -1.0)):
            if b != GROUND:
                body = rigid.rigid_bodies[b]
                moment = joint.length * F[:3] + np.cross(joint.place - body.centre, F[3:])
                half = np.linalg.cholesky(np.linalg.inv(body.inertia)).T
                row[6 * b : 6 * b + 6] = sign * np.concatenate([F[3:] / math.sqrt(body.mass), half @ moment])
    return found


def _allowed(rigid: Rigid, count: int) -> Array:
    """Motions that couplers allow, orthonormal, shape (count, motion_count), float64; all of them without couplers."""
    gears = [row for row in rigid.rigid_rows if row.geared >= 0]
    if not gears:
        return np.eye(count)
    rows = []
    for row in gears:
        own, other = (_gradients(rigid, rigid.body_joints[k]) for k in (row.geared, row.leader))
        tied = own[row.rates[0]] - row.ratio * other[row.rates[1]]
        rows.append(tied / np.linalg.norm(tied))
    _, sizes, turned = np.linalg.svd(np.array(rows))
    return turned[int((sizes > 1e-9).sum()) :].T


def _largest(body: RigidBody, X: Array, stiffness: Array) -> float:
    """Largest eigenvalue [1/s^2] of a free rigid body on springs at its own nodes, of any direction [N/m]."""
    from scipy.linalg import eigh

    arm = X[body.own] - body.centre
    moment, squares = stiffness @ arm, np.einsum("n,ni,nj->ij", stiffness, arm, arm)
    cross = np.cross(np.eye(3), moment)
    K = np.block([[stiffness.sum() * np.eye(3), cross], [cross.T, np.trace(squares) * np.eye(3) - squares]])
    M = np.block([[body.mass * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), body.inertia]])
    return float(eigh(K, M, eigvals_only=True)[-1])


def likely_rate(body: RigidBody, scene: Scene, rate: Array, points: Sequence[Array]) -> float:
    """Angular speed that a body is likely to reach [rad/s]; what turns faster in the run is told at its end.

    A free body reaches the greatest that energy and angular momentum allow. One that is held at some points may fall
    from above one of them: I w^2 / 2 = 2 m g d, in a short time no further than w = (m g d / I) t.

    Args:
        body: the body.
        scene: that it belongs to.
        rate: its angular velocity at the start [rad/s], shape (3,), float64.
        points: at which others or the ground hold it [m], each shape (3,).
    """
    if not points:
        return _greatest_free(body, rate)
    arms = np.linalg.norm(np.array(points) - body.centre, axis=1)
    about = np.linalg.eigvalsh(body.inertia)[0] + body.mass * arms**2
    square = float((body.mass * np.linalg.norm(scene.gravity) * arms / about).max())
    return math.hypot(float(np.linalg.norm(rate)), min(2.0 * math.sqrt(square), square * scene.impact.duration))


def _greatest_free(body: RigidBody, rate: Array) -> float:
    """Greatest angular speed of a body that turns freely [rad/s].

    Squares w_k^2 >= 0 of its components keep sum J_k w_k^2 and sum J_k^2 w_k^2, so that the greatest sum of the squares
    lies where one of them is 0.
    """
    J, axes = np.linalg.eigh(body.inertia)
    square = (axes.T @ rate) ** 2
    found = float(square.sum())
    for k in range(3):
        a, b = (m for m in range(3) if m != k)
        if J[b] - J[a] > ALIKE * J[2]:
            given = np.array([J @ square, J**2 @ square])
            there = np.linalg.solve([[J[a], J[b]], [J[a] ** 2, J[b] ** 2]], given)
            if there.min() >= 0.0:
                found = max(found, float(there.sum()))
    return math.sqrt(found)


def _rate(body: RigidBody, parts: Assembly, velocity: Array) -> Array:
    """Angular velocity of a body at the start [rad/s], shape (3,), float64."""
    nodes = body.nodes
    arm, mass = parts.X[nodes] - body.centre, parts.mass[nodes]
    spin = mass @ np.cross(arm, velocity[nodes])
    return np.asarray(np.linalg.solve(body.inertia, spin), dtype=np.float64)
