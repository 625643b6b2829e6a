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

wp.set_module_options({"enable_backward": False})

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
def find_motion(
    b: int,
    bodies: RigidBodies,
    span: wp.float64,
    rotation: wp.array(dtype=wp.quatd),
    momentum: wp.array(dtype=wp.vec3d),
    spin: wp.array(dtype=wp.vec3d),
    turn_out: wp.array(dtype=wp.vec3d),
    velocity_out: wp.array(dtype=wp.vec3d),
    rate_out: wp.array(dtype=wp.mat33d),
):
    """Motion of a body in the step: f, velocity V of its centre and D = (Q(n+1) - Q(n)) / span: v_i = V + D R_i."""
    q = rotation[b]
    f = step_rotation(bodies.inertia[b], bodies.inverse_inertia[b], wp.quat_rotate_inv(q, spin[b]), span)
    turn_out[b] = f
    velocity_out[b] = momentum[b] / bodies.mass[b]
    cross = wp.skew(f)
    scale = wp.float64(2.0) / (span * (wp.float64(1.0) + wp.dot(f, f)))
    rate_out[b] = scale * (wp.quat_to_matrix(q) * (cross + cross * cross))
