"""Owns what rigid bodies allow as a time step: the springs that may press them at once, and how fast they turn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.kernels.nodes.joint_arrays import ARMATURE, KP, LIMIT_STIFFNESS, STIFFNESS
from warp_mca.model.assembly import Assembly
from warp_mca.model.stable_step import BOUNCE, USUAL_SCALE
from warp_mca.physics.rigid.bodies import Rigid
from warp_mca.scene import Contact, RigidPlane, Scene
from warp_mca.system.bodies import GROUND
from warp_mca.system.rigid import RigidBody
from warp_mca.system.time_step import StableStep

WHOLE = 100.0
TURN = 0.01  # of a body in a step at most [rad]: its scheme is then off by some 1e-5 of the angle


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
    longest = parts.scene.impact.output_interval
    found = StableStep(dt=longest, element=0, contact_share=0.0, shortened=1.0)
    if not parts.rigid.all():
        found = parts.stable(others)
    for body in bodies:
        element = parts.element_start[body.name]
        worst = (2.0 * USUAL_SCALE) ** 2 / BOUNCE * _largest(body, parts.X, added[body.own] * parts.mass[body.own])
        if worst * found.dt**2 > 4.0:
            found = StableStep(dt=2.0 / math.sqrt(worst), element=element, contact_share=1.0, shortened=1.0)
        rate = _rate(body, parts, velocity)
        if rate * found.dt > TURN:
            found = replace(found, dt=TURN / rate, element=element, contact_share=0.0)
    stiffest, body = _stiffest(rigid)
    if stiffest * found.dt**2 > 4.0:
        element = parts.element_start[bodies[body].name]
        found = replace(found, dt=2.0 / math.sqrt(stiffest), element=element, contact_share=0.0)
    return found


def _stiffest(rigid: Rigid) -> tuple[float, int]:
    """Largest eigenvalue [1/s^2] of free rigid bodies on the springs of their joints, and a body that moves with it.

    Springs of limits count WHOLE times. What joints hold moves less, and rotors make it slower.
    """
    count = 6 * len(rigid.rigid_bodies)
    K, most = np.zeros((count, count)), (0.0, 0)
    for item in rigid.body_joints:
        screws, k = item.screws(), item.drive[:, [STIFFNESS, KP]].sum(axis=1) + WHOLE * item.drive[:, LIMIT_STIFFNESS]
        for F, stiffness, A in zip(np.linalg.pinv(screws).T, k, item.drive[:, ARMATURE], strict=True):
            row = np.zeros(count)
            for b, sign in ((item.body, 1.0), (item.other, -1.0)):
                if b != GROUND and stiffness > 0.0:
                    body = rigid.rigid_bodies[b]
                    moment = item.length * F[:3] + np.cross(item.place - body.centre, F[3:])
                    half = np.linalg.cholesky(np.linalg.inv(body.inertia)).T
                    row[6 * b : 6 * b + 6] = sign * np.concatenate([F[3:] / math.sqrt(body.mass), half @ moment])
            K += stiffness / (1.0 + A * (row @ row)) * np.outer(row, row)
    if K.any():
        values, vectors = np.linalg.eigh(K)
        most = float(values[-1]), int(np.abs(vectors[:, -1]).argmax()) // 6
    return most


def _largest(body: RigidBody, X: Array, stiffness: Array) -> float:
    """Largest eigenvalue [1/s^2] of a free rigid body on springs at its own nodes, of any direction [N/m]."""
    from scipy.linalg import eigh

    arm = X[body.own] - body.centre
    moment, squares = stiffness @ arm, np.einsum("n,ni,nj->ij", stiffness, arm, arm)
    cross = np.cross(np.eye(3), moment)
    K = np.block([[stiffness.sum() * np.eye(3), cross], [cross.T, np.trace(squares) * np.eye(3) - squares]])
    M = np.block([[body.mass * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), body.inertia]])
    return float(eigh(K, M, eigvals_only=True)[-1])


def _rate(body: RigidBody, parts: Assembly, velocity: Array) -> float:
    """Angular speed of a body at the start [rad/s]."""
    nodes = body.nodes
    arm, mass = parts.X[nodes] - body.centre, parts.mass[nodes]
    spin = mass @ np.cross(arm, velocity[nodes])
    return float(np.linalg.norm(np.linalg.solve(body.inertia, spin)))
