"""Owns rigid bodies in a step: forces on their nodes become momentum and spin, and their motion that of their nodes.

Nodes of flexible bodies that joints tie to those of a rigid body ride on it: they have part in its mass and inertia,
and the forces of their elements act on it. `rigid_motion` has the equations, `rigid_rows` joints between rigid bodies.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.block import block_sum, wait_for_block
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.cluster import Clusters, spin_after
from warp_mca.kernels.nodes.coupling import turned
from warp_mca.kernels.nodes.gather import Kind, NodeData, NodeState, move, total_force_function
from warp_mca.kernels.nodes.jointed_rows import jointed_lightness, note_rank, place_joints, satisfy_joints
from warp_mca.kernels.nodes.rigid_motion import Poses, RigidBodies, RigidStep, find_motion, turned_by
from warp_mca.kernels.nodes.rigid_pins import find_cluster, pull_cluster
from warp_mca.kernels.nodes.rigid_rows import RigidRows, place_row, row_lightness, satisfy
from warp_mca.kernels.nodes.symmetric import factorise

Wrench = wp.types.vector(length=6, dtype=wp.float64)  # force and moment


@cache
def load_function(own: Kind) -> Any:
    """The function that lets the forces on its nodes act on a body."""
    vec3, total_force = scalars(own.precision).vec3, total_force_function(own)

    @wp.func
    def load_body(
        b: int,
        lane: int,
        kick: wp.float64,
        bodies: RigidBodies,
        nodes: NodeData,
        force: wp.array(dtype=vec3),
        nodal_force_out: wp.array(dtype=wp.vec3d),
        poses_out: Poses,
        step_out: RigidStep,
    ):
        q = poses_out.rotation[b]
        total = Wrench()
        for e in range(bodies.begin[b] + lane, bodies.begin[b + 1], wp.block_dim()):
            i = bodies.node[e]
            f = total_force(i, nodes.first_slots[i], nodes, force, nodal_force_out)
            step_out.force[e] = f
            moment = wp.cross(wp.quat_rotate(q, bodies.arm[e]), f)
            for c in range(3):
                total[c] += f[c]
                total[3 + c] += moment[c]
        total = block_sum(total)
        sum_F = wp.vec3d(total[0], total[1], total[2])
        sum_T = wp.vec3d(total[3], total[4], total[5])
        if lane == 0:
            weight = bodies.mass[b] * bodies.gravity[b]
            poses_out.momentum[b] = poses_out.momentum[b] + kick * (sum_F + weight)
            poses_out.spin[b] = poses_out.spin[b] + kick * sum_T

    return load_body


@wp.func
def move_on(b: int, span: wp.float64, moves: bool, poses_out: Poses, step_out: RigidStep):
    """Take the pose of a body from t(n) to t(n+1), if it moves, and say what Q - I is then."""
    if moves:
        f = step_out.turn[b]
        poses_out.turn[b] = wp.max(poses_out.turn[b], wp.float64(2.0) * wp.atan(wp.length(f)))
        poses_out.centre[b] = poses_out.centre[b] + span * step_out.velocity[b]
        poses_out.rotation[b] = wp.normalize(poses_out.rotation[b] * wp.quatd(f[0], f[1], f[2], wp.float64(1.0)))
    step_out.turned[b] = turned_by(poses_out.rotation[b])


@wp.func
def count_riders(
    b: int,
    lane: int,
    kick: wp.float64,
    bodies: RigidBodies,
    mass: wp.array(dtype=wp.float64),
    v: wp.array(dtype=wp.vec3d),
    step: RigidStep,
    impulse_out: wp.array(dtype=wp.vec3d),
):
    """Add the impulse that holds each rider of a body, m (v(n+1/2) - v(n-1/2)) - dt f, to that of its pair [N s]."""
    for e in range(bodies.begin[b] + lane, bodies.begin[b + 1], wp.block_dim()):
        pair = bodies.pair[e]
        if pair >= 0:
            i = bodies.node[e]
            gained = mass[i] * (step.velocity[b] + step.rate[b] * bodies.arm[e] - v[i] - kick * bodies.gravity[b])
            impulse_out[pair] = impulse_out[pair] + bodies.sign[e] * (gained - kick * step.force[e])


@cache
def advance_kernel(own: Kind, jointed: bool = False) -> Any:
    """Kernel: momentum, spin and pose of rigid bodies by a step; a block of threads takes a group's bodies in turn.

    `jointed`: joints between whole bodies connect some.

    v(n+1/2) follows from the forces at t(n) in `kick` [s], and takes nodes to t(n+1) in `span` [s]; poses move on with
    `moves`. kick = span = -dt / 2 and -dt without it give the motion of the step before the first one. impulse_out
    takes the impulses of joints, see `constraint.bound_kernel`.
    """
    vec3, load_body = scalars(own.precision).vec3, load_function(own)
    lightness = jointed_lightness if jointed else row_lightness

    @wp.kernel(enable_backward=False, module="unique")
    def advance_rigid(
        bodies: RigidBodies,
        rows: RigidRows,
        clusters: Clusters,
        X: wp.array(dtype=wp.vec3d),
        nodes: NodeData,
        force: wp.array(dtype=vec3),
        kick: wp.float64,
        span: wp.float64,
        moves: bool,
        state_out: NodeState,
        poses_out: Poses,
        impulse_out: wp.array(dtype=wp.vec3d),
        step_out: RigidStep,
    ):
        k, lane = wp.tid()
        begin = rows.begin[k]
        size = rows.begin[k + 1] - begin
        for place in range(rows.body[k], rows.body[k + 1]):
            b = rows.member[place]
            load_body(b, lane, kick, bodies, nodes, force, state_out.nodal_force, poses_out, step_out)
            if lane == 0:
                find_motion(b, bodies, span, poses_out, step_out)
        for p in range(rows.pins[k], rows.pins[k + 1]):
            find_cluster(p, lane, rows.place[p], clusters, X, nodes.mass, span, poses_out, state_out, step_out)
        if size > 0:
            for r in range(begin + lane, begin + size, wp.block_dim()):
                place_row(r, rows, span, poses_out, step_out)
            if wp.static(jointed):
                place_joints(k, lane, kick, span, moves, bodies, rows, poses_out, impulse_out, step_out)
            wait_for_block()
            for e in range(lane, size * size, wp.block_dim()):
                speed = lightness(begin + e // size, begin + e % size, bodies, rows, moves, step_out)
                step_out.matrix[rows.entry[k] + e] = speed
            wait_for_block()
            factorise(rows.entry[k], size, lane, begin, step_out.matrix, step_out.share)
            if wp.static(jointed):
                if moves and lane == 0:
                    note_rank(k, rows, poses_out, step_out)
                satisfy_joints(k, lane, span, moves, bodies, rows, clusters, poses_out, impulse_out, step_out)
            elif lane == 0:
                satisfy(k, span, moves, bodies, rows, clusters, poses_out, impulse_out, step_out)
        wait_for_block()
        if moves:
            for p in range(rows.pins[k], rows.pins[k + 1]):
                pull_cluster(p, lane, rows.place[p], clusters, X, span, step_out, state_out)
                if lane == 0:
                    m = step_out.mean[p]
                    w = spin_after(m, m.spin, step_out.impulse[p, 0], step_out.impulse[p, 1])
                    poses_out.orientation[p] = turned(poses_out.orientation[p], span * w)
        for place in range(rows.body[k], rows.body[k + 1]):
            b = rows.member[place]
            if moves:
                count_riders(b, lane, kick, bodies, nodes.mass, state_out.v, step_out, impulse_out)
            if lane == 0:
                move_on(b, span, moves, poses_out, step_out)

    return advance_rigid


@wp.kernel(enable_backward=False)
def follow(
    node: wp.array(dtype=wp.int32),
    body: wp.array(dtype=wp.int32),
    arm: wp.array(dtype=wp.vec3d),
    centre: wp.array(dtype=wp.vec3d),
    step: RigidStep,
    state_out: NodeState,
):
    """Give the nodes of rigid bodies, riders included, their displacement and velocity."""
    k = wp.tid()
    b = body[k]
    move(node[k], centre[b] + step.turned[b] * arm[k], step.velocity[b] + step.rate[b] * arm[k], state_out)
