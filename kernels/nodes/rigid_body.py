"""Owns rigid bodies in a step: forces on their nodes become momentum and spin, and their motion that of their nodes.

Nodes of flexible bodies that joints tie to those of a rigid body ride on it: they have part in its mass and inertia,
and the forces of their elements act on it. `rigid_motion` has the equations, `rigid_rows` joints between rigid bodies.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.block import block_sum, wait_for_block
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.cluster import Clusters, Mean, spin_after
from warp_mca.kernels.nodes.coupling import turned
from warp_mca.kernels.nodes.gather import Kind, NodeData, NodeState, move, total_force_function
from warp_mca.kernels.nodes.rigid_motion import RigidBodies, find_motion, turned_by
from warp_mca.kernels.nodes.rigid_pins import find_cluster, pull_cluster
from warp_mca.kernels.nodes.rigid_rows import RigidRows, place_row, row_lightness, satisfy
from warp_mca.kernels.nodes.symmetric import factorise

wp.set_module_options({"enable_backward": False})

Wrench = wp.types.vector(length=6, dtype=wp.float64)  # force and moment


@cache
def load_function(own: Kind) -> Any:
    """The function that lets the forces on its nodes act on a body."""
    vec3, total_force = scalars(own.precision).vec3, total_force_function(own)

    @wp.func
    def load(
        b: int,
        lane: int,
        kick: wp.float64,
        bodies: RigidBodies,
        rotation: wp.array(dtype=wp.quatd),
        nodes: NodeData,
        force: wp.array(dtype=vec3),
        nodal_force_out: wp.array(dtype=wp.vec3d),
        momentum_out: wp.array(dtype=wp.vec3d),
        spin_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
    ):
        q = rotation[b]
        total = Wrench()
        for e in range(bodies.begin[b] + lane, bodies.begin[b + 1], wp.block_dim()):
            i = bodies.node[e]
            f = total_force(i, nodes.first_slots[i], nodes, force, nodal_force_out)
            work_out[e] = f
            moment = wp.cross(wp.quat_rotate(q, bodies.arm[e]), f)
            for c in range(3):
                total[c] += f[c]
                total[3 + c] += moment[c]
        total = block_sum(total)
        sum_F = wp.vec3d(total[0], total[1], total[2])
        sum_T = wp.vec3d(total[3], total[4], total[5])
        if lane == 0:
            momentum_out[b] = momentum_out[b] + kick * (sum_F + bodies.mass[b] * bodies.gravity[b])
            spin_out[b] = spin_out[b] + kick * sum_T

    return load


@wp.func
def move_on(
    b: int,
    span: wp.float64,
    moves: bool,
    turn: wp.array(dtype=wp.vec3d),
    velocity: wp.array(dtype=wp.vec3d),
    centre_out: wp.array(dtype=wp.vec3d),
    rotation_out: wp.array(dtype=wp.quatd),
    turned_out: wp.array(dtype=wp.mat33d),
):
    """Take the pose of a body from t(n) to t(n+1), if it moves, and say what Q - I is then."""
    if moves:
        f = turn[b]
        centre_out[b] = centre_out[b] + span * velocity[b]
        rotation_out[b] = wp.normalize(rotation_out[b] * wp.quatd(f[0], f[1], f[2], wp.float64(1.0)))
    turned_out[b] = turned_by(rotation_out[b])


@wp.func
def count_riders(
    b: int,
    lane: int,
    kick: wp.float64,
    bodies: RigidBodies,
    mass: wp.array(dtype=wp.float64),
    v: wp.array(dtype=wp.vec3d),
    force: wp.array(dtype=wp.vec3d),
    velocity: wp.array(dtype=wp.vec3d),
    rate: wp.array(dtype=wp.mat33d),
    impulse_out: wp.array(dtype=wp.vec3d),
):
    """Add the impulse that holds each rider of a body, m (v(n+1/2) - v(n-1/2)) - dt f, to that of its pair [N s]."""
    for e in range(bodies.begin[b] + lane, bodies.begin[b + 1], wp.block_dim()):
        pair = bodies.pair[e]
        if pair >= 0:
            i = bodies.node[e]
            gained = mass[i] * (velocity[b] + rate[b] * bodies.arm[e] - v[i] - kick * bodies.gravity[b])
            impulse_out[pair] = impulse_out[pair] + bodies.sign[e] * (gained - kick * force[e])


@cache
def advance_kernel(own: Kind) -> Any:
    """Kernel: momentum, spin and pose of rigid bodies by a step; a block of threads takes a group's bodies in turn.

    v(n+1/2) follows from the forces at t(n) in `kick` [s], and takes nodes to t(n+1) in `span` [s]; poses move on with
    `moves`. kick = span = -dt / 2 and -dt without it give the motion of the step before the first one. turned_out is
    Q - I after the step, the other outputs from force_out on are as in `find_motion`, `rigid_rows` and `rigid_pins`.
    """
    vec3, load = scalars(own.precision).vec3, load_function(own)

    # fmt: off
    @wp.kernel(enable_backward=False, module="unique")
    def advance_rigid(
        bodies: RigidBodies, rows: RigidRows, clusters: Clusters, X: wp.array(dtype=wp.vec3d),
        nodes: NodeData, force: wp.array(dtype=vec3), kick: wp.float64, span: wp.float64, moves: bool,
        state_out: NodeState,
        centre_out: wp.array(dtype=wp.vec3d), rotation_out: wp.array(dtype=wp.quatd),
        momentum_out: wp.array(dtype=wp.vec3d), spin_out: wp.array(dtype=wp.vec3d),
        orientation_out: wp.array(dtype=wp.quatd), impulse_out: wp.array(dtype=wp.vec3d),
        force_out: wp.array(dtype=wp.vec3d), turn_out: wp.array(dtype=wp.vec3d),
        velocity_out: wp.array(dtype=wp.vec3d), rate_out: wp.array(dtype=wp.mat33d),
        turned_out: wp.array(dtype=wp.mat33d), normal_out: wp.array(dtype=wp.vec3d),
        twist_out: wp.array(dtype=wp.vec3d), lever_out: wp.array2d(dtype=wp.vec3d),
        gap_out: wp.array(dtype=wp.float64), value_out: wp.array(dtype=wp.float64),
        matrix_out: wp.array(dtype=wp.float64), mean_out: wp.array(dtype=Mean),
        point_out: wp.array(dtype=wp.vec3d), pin_impulse_out: wp.array2d(dtype=wp.vec3d),
        place_out: wp.array(dtype=wp.vec3d), axis_out: wp.array(dtype=wp.vec3d),
    ):
        k, lane = wp.tid()
        begin = rows.begin[k]
        size = rows.begin[k + 1] - begin
        for place in range(rows.body[k], rows.body[k + 1]):
            b = rows.member[place]
            load(b, lane, kick, bodies, rotation_out, nodes, force, state_out.nodal_force, momentum_out, spin_out,
                 force_out)
            if lane == 0:
                find_motion(b, bodies, span, rotation_out, momentum_out, spin_out, turn_out, velocity_out, rate_out)
        for p in range(rows.pins[k], rows.pins[k + 1]):
            find_cluster(p, lane, rows.place[p], clusters, X, nodes.mass, span, orientation_out, state_out.u,
                         state_out.v, mean_out, point_out, pin_impulse_out)
        if size > 0:
            for r in range(begin + lane, begin + size, wp.block_dim()):
                place_row(r, rows, span, centre_out, rotation_out, normal_out, twist_out, lever_out, gap_out)
            wait_for_block()
            for e in range(lane, size * size, wp.block_dim()):
                r = begin + e // size
                s = begin + e % size
                x = row_lightness(r, s, bodies, rows, moves, normal_out, twist_out, lever_out, mean_out)
                matrix_out[rows.entry[k] + e] = x
            wait_for_block()
            if lane == 0:
                factorise(rows.entry[k], size, matrix_out)
                satisfy(k, span, moves, bodies, rows, clusters, orientation_out, mean_out, point_out, rotation_out,
                        normal_out, twist_out, lever_out, gap_out, matrix_out, momentum_out, spin_out, impulse_out,
                        pin_impulse_out, place_out, axis_out, turn_out, velocity_out, rate_out, value_out)
        wait_for_block()
        if moves:
            for p in range(rows.pins[k], rows.pins[k + 1]):
                pull_cluster(p, lane, rows.place[p], clusters, X, span, mean_out, point_out, pin_impulse_out,
                             state_out.u, state_out.v, state_out.speed_square)
                if lane == 0:
                    w = spin_after(mean_out[p], mean_out[p].spin, pin_impulse_out[p, 0], pin_impulse_out[p, 1])
                    orientation_out[p] = turned(orientation_out[p], span * w)
        for place in range(rows.body[k], rows.body[k + 1]):
            b = rows.member[place]
            if moves:
                count_riders(b, lane, kick, bodies, nodes.mass, state_out.v, force_out, velocity_out, rate_out,
                             impulse_out)
            if lane == 0:
                move_on(b, span, moves, turn_out, velocity_out, centre_out, rotation_out, turned_out)

    # fmt: on
    return advance_rigid


@wp.kernel(enable_backward=False)
def follow(
    node: wp.array(dtype=wp.int32),
    body: wp.array(dtype=wp.int32),
    arm: wp.array(dtype=wp.vec3d),
    centre: wp.array(dtype=wp.vec3d),
    velocity: wp.array(dtype=wp.vec3d),
    rate: wp.array(dtype=wp.mat33d),
    turned: wp.array(dtype=wp.mat33d),
    state_out: NodeState,
):
    """Give the nodes of rigid bodies, riders included, their displacement and velocity."""
    k = wp.tid()
    i = node[k]
    b = body[k]
    move(i, centre[b] + turned[b] * arm[k], velocity[b] + rate[b] * arm[k], state_out)
