"""Owns the damping of bodies at their nodes: in proportion to mass and stiffness, and by Maxwell branches.

With f(n) the sum of the forces of elements on a node at t(n), and R the rotation of its body in the last step,

    df = f(n) - R f(n-1),    y_k(n) = e^(-dt / tau_k) R y_k(n-1) + a_k df,    a_k = (1 - e^(-dt / tau_k)) tau_k / dt,
    F(n) = beta df / dt + sum g_k y_k(n) - (1 - e^(-alpha dt)) m (v(n-1/2) - v_rigid) / dt.

df / dt is -K v(n-1/2) for elements that are linear, so that no element computes a rate. Where the body does nothing but
turn, df is zero. The y_k solve dy/dt + y / tau = df/dt exactly for forces that are linear in a step. Forces F of the
mass part that act relative to the body's own mean motion have no resultant and no moment. Between t(n-1) and t(n) all
F take the energy -dt / 2 (F(n-1) + F(n)) . v(n-1/2) of v(n-1/2) . M v(n+1/2) / 2.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.block import block_sum
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.gather import Kind, NodeData, element_force_function
from warp_mca.kernels.records.ledger import run_of

Sums = wp.types.vector(length=16, dtype=wp.float64)  # m, m r, m v, m r x v, and m r r^T in six numbers

ALL_AXES = 4  # of `DampedBodies.turns`


@wp.struct
class DampedBodies:
    """The damped bodies of a model.

    Attributes:
        begin: first of each body's nodes, and the number of all, shape (body_count + 1,), int32.
        mass_rate: alpha, as (1 - exp(-alpha dt)) / dt [1/s], shape (body_count,), float64.
        lag: beta / dt [-], shape (body_count,), float64.
        ground: 1 where alpha acts on all motion, shape (body_count,), int32.
        turns: axis + 1 about which the body may turn, 0 about none, ALL_AXES about all, shape (body_count,), int32.
        anchor: node whose velocity the body has along each axis, -1 where it is free, shape (body_count,), vec3i.
        branch: first Maxwell branch of each body, and the number of all, shape (body_count + 1,), int32.
        stored: first y of each body, shape (body_count,), int32.
        gain, keep, share: g_k, e^(-dt / tau_k) and a_k of each branch [-], shape (branch_count,), float64.
    """

    begin: wp.array(dtype=wp.int32)
    mass_rate: wp.array(dtype=wp.float64)
    lag: wp.array(dtype=wp.float64)
    ground: wp.array(dtype=wp.int32)
    turns: wp.array(dtype=wp.int32)
    anchor: wp.array(dtype=wp.vec3i)
    branch: wp.array(dtype=wp.int32)
    stored: wp.array(dtype=wp.int32)
    gain: wp.array(dtype=wp.float64)
    keep: wp.array(dtype=wp.float64)
    share: wp.array(dtype=wp.float64)


@wp.struct
class BodyMotion:
    """Mean rigid motion of each damped body.

    Attributes:
        place: of the mass centre [m], shape (body_count,), vec3d.
        velocity: of it [m/s], shape (body_count,), vec3d.
        spin: angular velocity [rad/s], shape (body_count,), vec3d.
    """

    place: wp.array(dtype=wp.vec3d)
    velocity: wp.array(dtype=wp.vec3d)
    spin: wp.array(dtype=wp.vec3d)


@wp.kernel(enable_backward=False)
def sum_bodies(
    bodies: DampedBodies,
    node: wp.array(dtype=wp.int32),
    mass: wp.array(dtype=wp.float64),
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    partial_out: wp.array2d(dtype=Sums),
):
    """Sums over the nodes of a run of a body, by a block of threads, with r from the first node of the body."""
    b, k, lane = wp.tid()
    first = node[bodies.begin[b]]
    origin = X[first] + u[first]
    found = Sums()
    begin, end = run_of(bodies.begin[b], bodies.begin[b + 1], k)
    for e in range(begin + lane, end, wp.block_dim()):
        i = node[e]
        m = mass[i]
        r = X[i] + u[i] - origin
        p = m * v[i]
        L = wp.cross(r, p)
        found[0] += m
        for c in range(3):
            found[1 + c] += m * r[c]
            found[4 + c] += p[c]
            found[7 + c] += L[c]
            found[10 + c] += m * r[c] * r[c]
            found[13 + c] += m * r[c] * r[(c + 1) % 3]
    total = block_sum(found)
    if lane == 0:
        partial_out[b, k] = total


@wp.kernel(enable_backward=False)
def find_mean_motion(
    bodies: DampedBodies,
    runs: int,
    node: wp.array(dtype=wp.int32),
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    partial: wp.array2d(dtype=Sums),
    motion_out: BodyMotion,
):
    """The rigid motion with the momentum and spin of each body, of those that its held nodes allow."""
    b, lane = wp.tid()
    found = Sums()
    for k in range(lane, runs, wp.block_dim()):
        found += partial[b, k]
    total = block_sum(found)
    if lane == 0:
        m = total[0]
        centre = wp.vec3d(total[1], total[2], total[3]) / m
        velocity = wp.vec3d(total[4], total[5], total[6]) / m
        L = wp.vec3d(total[7], total[8], total[9]) - m * wp.cross(centre, velocity)
        S = wp.mat33d()
        for c in range(3):
            n = (c + 1) % 3
            S[c, c] = total[10 + c] - m * centre[c] * centre[c]
            S[c, n] = total[13 + c] - m * centre[c] * centre[n]
            S[n, c] = S[c, n]
        J = wp.trace(S) * wp.identity(n=3, dtype=wp.float64) - S
        spin = wp.vec3d()
        turns = bodies.turns[b]
        if turns == wp.static(ALL_AXES):
            spin = wp.inverse(J) * L
        elif turns > 0:
            spin[turns - 1] = L[turns - 1] / J[turns - 1, turns - 1]
        anchor = bodies.anchor[b]
        for c in range(3):
            if anchor[c] >= 0:
                velocity[c] = v[anchor[c]][c]
        first = node[bodies.begin[b]]
        motion_out.place[b] = X[first] + u[first] + centre
        motion_out.velocity[b] = velocity
        motion_out.spin[b] = spin


@wp.func
def mass_force(
    i: int, b: int, bodies: DampedBodies, nodes: NodeData, X: wp.vec3d, u: wp.vec3d, v: wp.vec3d, motion: BodyMotion
):
    """-alpha m (v - v_rigid) on node i of body b [N]."""
    own = wp.vec3d()
    if bodies.ground[b] == 0:
        own = motion.velocity[b] + wp.cross(motion.spin[b], X + u - motion.place[b])
    return -bodies.mass_rate[b] * nodes.mass[i] * (v - own)


@wp.kernel(enable_backward=False)
def damp_at_start(
    bodies: DampedBodies,
    body: wp.array(dtype=wp.int32),
    node: wp.array(dtype=wp.int32),
    nodes: NodeData,
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    motion: BodyMotion,
    nodal_force_out: wp.array(dtype=wp.vec3d),
):
    """Add the force of the mass part at t = 0."""
    e = wp.tid()
    i = node[e]
    nodal_force_out[i] = nodal_force_out[i] + mass_force(i, body[e], bodies, nodes, X[i], u[i], v[i], motion)


@cache
def damp_kernel(own: Kind) -> Any:
    """Kernel: add the damping force F(n) to each node of the damped bodies, and count the energy that it takes.

    force_out, damping_out: of elements and of damping, those of the step before [N]; branch_out: y_k, node by node in
    each body [N]; taken_out: up to t(n) [J]; clock_out: steps that each node has taken.
    """
    vec3, element_force = scalars(own.precision).vec3, element_force_function(own)

    @wp.kernel(enable_backward=False, module="unique")
    def damp_nodes(
        first: int,
        bodies: DampedBodies,
        body: wp.array(dtype=wp.int32),
        node: wp.array(dtype=wp.int32),
        nodes: NodeData,
        force: wp.array(dtype=vec3),
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        motion: BodyMotion,
        dt: wp.float64,
        nodal_force_out: wp.array(dtype=wp.vec3d),
        force_out: wp.array(dtype=wp.vec3d),
        damping_out: wp.array(dtype=wp.vec3d),
        branch_out: wp.array(dtype=wp.vec3d),
        taken_out: wp.array(dtype=wp.float64),
        clock_out: wp.array(dtype=wp.int32),
    ):
        e = first + wp.tid()
        i = node[e]
        b = body[e]
        v_i = v[i]
        half = wp.float64(0.5) * dt * motion.spin[b]
        turn = wp.normalize(wp.quatd(half[0], half[1], half[2], wp.float64(1.0)))
        f = element_force(i, nodes.first_slots[i], nodes, force)
        change = wp.vec3d()
        if clock_out[e] > 0:
            change = f - wp.quat_rotate(turn, force_out[e])
        F = bodies.lag[b] * change + mass_force(i, b, bodies, nodes, X[i], u[i], v_i, motion)
        begin = bodies.branch[b]
        count = bodies.branch[b + 1] - begin
        place = bodies.stored[b] + (e - bodies.begin[b]) * count
        for k in range(count):
            y = bodies.keep[begin + k] * wp.quat_rotate(turn, branch_out[place + k]) + bodies.share[begin + k] * change
            branch_out[place + k] = y
            F += bodies.gain[begin + k] * y
        if clock_out[e] > 0:
            taken_out[e] = taken_out[e] - wp.float64(0.5) * dt * wp.dot(damping_out[e] + F, v_i)
        force_out[e] = f
        damping_out[e] = F
        clock_out[e] = 1
        nodal_force_out[i] = nodal_force_out[i] + F

    return damp_nodes
