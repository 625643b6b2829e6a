"""Owns the motion of a rigid body in a step: from momentum and spin to displacement and rotation.

Central differences of nodes that are held together by rigid links are the discrete equations of a rigid body (Moser and
Veselov, Commun. Math. Phys. 139 (1991) 217). With arms r_i of the nodes at t(n), lumped masses m_i, and velocities
v_i(n+1/2) that take each node from where it is at t(n) to where it is at t(n+1),

    P(n+1/2) = P(n-1/2) + dt sum f_i,          P = sum m_i v_i,
    L(n+1/2) = L(n-1/2) + dt sum r_i x f_i,    L = sum m_i r_i x v_i about the mass centre.

The rotation F of a step, Q(n+1) = Q(n) F, follows from m = Q(n)^T L by Cayley's form F = (I + [f])(I - [f])^-1 with

    J f + f x J f = (dt / 2) (1 + f . f) m,

J the inertia of the nodes in the body's frame (Lee, Leok and McClamroch, Comput. Methods Appl. Mech. Engrg. 196 (2007)
2907, there with sin and cos of the angle). Sums over the nodes give P and L to rounding, and a free body keeps them.
The scheme is symplectic, so that the energy of a free body does not drift.
"""

import warp as wp

from warp_mca.kernels.nodes.cluster import Mean
from warp_mca.kernels.nodes.joint_arrays import JointPoses, JointStep

SOLVES = 50  # steps of Newton's method at most
ROUNDING = 1e-15  # change of the rotation of a step, relative, at which the steps end


@wp.struct
class RigidBodies:
    """The rigid bodies of a model.

    Attributes:
        mass: with riders [kg], shape (body_count,), float64.
        inertia, inverse_inertia: J about the mass centre along the axes of the reference positions [kg m^2], and its
            inverse, shape (body_count,), mat33d.
        gravity: on each [m/s^2], shape (body_count,), vec3d.
        begin: first of each body's nodes that forces may act on, and the number of all, shape (body_count + 1,), int32.
        node: these nodes, shape (loaded_count,), int32.
        arm: their reference positions from the mass centre [m], shape (loaded_count,), vec3d.
        pair: pair of `Model.joint_first` by which a rider is tied, -1 of own nodes, shape (loaded_count,), int32.
        sign: 1 where the rider is the first node of its pair, -1 where it is the second, shape (loaded_count,),
            float64.
    """

    mass: wp.array(dtype=wp.float64)
    inertia: wp.array(dtype=wp.mat33d)
    inverse_inertia: wp.array(dtype=wp.mat33d)
    gravity: wp.array(dtype=wp.vec3d)
    begin: wp.array(dtype=wp.int32)
    node: wp.array(dtype=wp.int32)
    arm: wp.array(dtype=wp.vec3d)
    pair: wp.array(dtype=wp.int32)
    sign: wp.array(dtype=wp.float64)


@wp.struct
class Poses:
    """State of the rigid bodies, see `physics.rigid.stage.RigidState`.

    Attributes:
        centre: displacement of each mass centre [m], shape (body_count,), vec3d.
        rotation: Q of each body, a unit quaternion [-], shape (body_count,), quatd.
        momentum: P at the latest half step [kg m/s], shape (body_count,), vec3d.
        spin: L at the latest half step [kg m^2/s], shape (body_count,), vec3d.
        orientation: rotation of the cluster of each pin [-], shape (pin_count,), quatd.
        turn: greatest turn of each body in a step [rad], shape (body_count,), float64.
        joints: state of the joints between whole bodies.
    """

    centre: wp.array(dtype=wp.vec3d)
    rotation: wp.array(dtype=wp.quatd)
    momentum: wp.array(dtype=wp.vec3d)
    spin: wp.array(dtype=wp.vec3d)
    orientation: wp.array(dtype=wp.quatd)
    turn: wp.array(dtype=wp.float64)
    joints: JointPoses


@wp.struct
class RigidStep:
    """What a step of the rigid bodies computes and forgets.

    Attributes:
        force: on each node that forces may act on [N], shape (loaded_count,), vec3d.
        turn: f of each body [-], shape (body_count,), vec3d.
        velocity: V of each mass centre [m/s], shape (body_count,), vec3d.
        rate: D = (Q(n+1) - Q(n)) / span of each body [1/s], shape (body_count,), mat33d: nodes move by v_i = V + D R_i.
        turned: Q - I after the step [-], shape (body_count,), mat33d.
        normal: n of each row at t(n) [-], shape (row_count,), vec3d.
        twist: of each row at t(n) [-], shape (row_count,), vec3d.
        lever: moments of a unit impulse of each row in the frames of its two bodies [m], shape (row_count, 2), vec3d.
        gap: speed that closes the opening of each row in the step [m/s], shape (row_count,), float64.
        value: speeds at which rows open, then their impulses [m/s], [N s], shape (row_count,), float64.
        matrix: opening speeds due to unit impulses, group by group, then factorised [1/kg], float64.
        share: of each row that does not follow from those before it in its group [-], shape (row_count,), float64.
        mean: motion of each pin's cluster after the free step, shape (pin_count,), Mean.
        point: P of each pin at t(n), from the place at the start [m], shape (pin_count,), vec3d.
        impulse: J and T of each pin on its cluster [N s], [N m s], shape (pin_count, 2), vec3d.
        place, axis: of each pin on its cluster at t(n+1) [m], [-], shape (pin_count,), vec3d.
        joints: what joints between whole bodies compute.
    """

    force: wp.array(dtype=wp.vec3d)
    turn: wp.array(dtype=wp.vec3d)
    velocity: wp.array(dtype=wp.vec3d)
    rate: wp.array(dtype=wp.mat33d)
    turned: wp.array(dtype=wp.mat33d)
    normal: wp.array(dtype=wp.vec3d)
    twist: wp.array(dtype=wp.vec3d)
    lever: wp.array2d(dtype=wp.vec3d)
    gap: wp.array(dtype=wp.float64)
    value: wp.array(dtype=wp.float64)
    matrix: wp.array(dtype=wp.float64)
    share: wp.array(dtype=wp.float64)
    mean: wp.array(dtype=Mean)
    point: wp.array(dtype=wp.vec3d)
    impulse: wp.array2d(dtype=wp.vec3d)
    place: wp.array(dtype=wp.vec3d)
    axis: wp.array(dtype=wp.vec3d)
    joints: JointStep


@wp.func
def turned_by(q: wp.quatd) -> wp.mat33d:
    """Q - I of a unit quaternion, without the difference of large numbers."""
    e = wp.vec3d(q[0], q[1], q[2])
    cross = wp.skew(e)
    return wp.float64(2.0) * (q[3] * cross + cross * cross)


@wp.func
def step_rotation(J: wp.mat33d, inverse_J: wp.mat33d, m: wp.vec3d, span: wp.float64) -> wp.vec3d:
    """f of the rotation in a step of `span` [s] with the momentum m = Q^T L in the body's frame."""
    half = wp.float64(0.5) * span
    f = half * (inverse_J * m)
    for _ in range(SOLVES):
        Jf = J * f
        off = Jf + wp.cross(f, Jf) - (half * (wp.float64(1.0) + wp.dot(f, f))) * m
        slope = J + wp.skew(f) * J - wp.skew(Jf) - span * wp.outer(m, f)
        change = wp.inverse(slope) * off
        f -= change
        if wp.length(change) <= wp.float64(ROUNDING) * wp.length(f):
            break
    return f


@wp.func
def find_motion(b: int, bodies: RigidBodies, span: wp.float64, poses: Poses, step_out: RigidStep):
    """Motion of a body in the step: f, the velocity V of its centre, and D."""
    q = poses.rotation[b]
    f = step_rotation(bodies.inertia[b], bodies.inverse_inertia[b], wp.quat_rotate_inv(q, poses.spin[b]), span)
    step_out.turn[b] = f
    step_out.velocity[b] = poses.momentum[b] / bodies.mass[b]
    cross = wp.skew(f)
    scale = wp.float64(2.0) / (span * (wp.float64(1.0) + wp.dot(f, f)))
    step_out.rate[b] = scale * (wp.quat_to_matrix(q) * (cross + cross * cross))
