"""Owns the conditions between rigid bodies and with the ground: rows, which impulses keep.

A row is the scalar condition n . (x_first - x_second) = 0 at t(n+1) for a point that two bodies share. Equal and
opposite impulses along n act at that point, so that momentum and angular momentum are kept. All rows of a group are
solved together by Newton's method, with the matrix of t(n): the rotation of a step is small, so that three or four
steps reach rounding.
"""

import warp as wp

from warp_mca.kernels.nodes.cluster import Clusters
from warp_mca.kernels.nodes.joint_arrays import RigidJoints
from warp_mca.kernels.nodes.rigid_motion import Poses, RigidBodies, RigidStep, find_motion, turned_by
from warp_mca.kernels.nodes.rigid_pins import move_pin, pin_lightness
from warp_mca.kernels.nodes.symmetric import solve_factorised

SOLVES = 50  # steps of Newton's method at most


@wp.struct
class RigidRows:
    """Conditions between rigid bodies, in groups of bodies that they connect.

    Attributes:
        member: bodies, group by group, shape (body_count,), int32.
        body, begin: first place in `member` and first row of each group, and the numbers of all, shape
            (group_count + 1,), int32.
        pins: first pin of each group, and the number of all, shape (group_count + 1,), int32.
        place: of each pin at the start [m], shape (pin_count,), vec3d.
        entry: first entry of each group's matrix, shape (group_count,), int32.
        first, second: bodies of each row, second -1 where that is the ground, shape (row_count,), int32.
        first_arm, second_arm: reference position of the common point from the bodies' mass centres [m], shape
            (row_count,), vec3d.
        direction: n at the reference positions [-], shape (row_count,), vec3d; it turns with the first body, unless the
            second is the ground.
        pin: that the row belongs to, -1 where the second side is no cluster, shape (row_count,), int32.
        twist: axis of a pin's row that holds a direction, at the reference positions, and 0 of other rows, whose n is 0
            there [-], shape (row_count,), vec3d.
        pair: that takes the row's impulse, -1 where none does, shape (row_count,), int32.
        sign: of this impulse, 1 where the first body is the joint's first one, else -1, shape (row_count,), float64.
        joint: between whole bodies that the row belongs to, -1 of others, shape (row_count,), int32.
        rate: of its freedoms that the row holds back, -1 of others, shape (row_count,), int32.
        part: rows of the two rates that a row ties as a coupler, -1 of other rows, shape (row_count,), vec2i.
        ratio: of the coupler, shape (row_count,), float64.
        offset: position of its one rate less ratio times that of the other [rad], [m], shape (row_count,), float64.
        joints: these.
    """

    member: wp.array(dtype=wp.int32)
    body: wp.array(dtype=wp.int32)
    begin: wp.array(dtype=wp.int32)
    pins: wp.array(dtype=wp.int32)
    place: wp.array(dtype=wp.vec3d)
    entry: wp.array(dtype=wp.int32)
    first: wp.array(dtype=wp.int32)
    second: wp.array(dtype=wp.int32)
    first_arm: wp.array(dtype=wp.vec3d)
    second_arm: wp.array(dtype=wp.vec3d)
    direction: wp.array(dtype=wp.vec3d)
    pin: wp.array(dtype=wp.int32)
    twist: wp.array(dtype=wp.vec3d)
    pair: wp.array(dtype=wp.int32)
    sign: wp.array(dtype=wp.float64)
    joint: wp.array(dtype=wp.int32)
    rate: wp.array(dtype=wp.int32)
    part: wp.array(dtype=wp.vec2i)
    ratio: wp.array(dtype=wp.float64)
    offset: wp.array(dtype=wp.float64)
    joints: RigidJoints


@wp.func
def lever(q: wp.quatd, arm: wp.vec3d, n: wp.vec3d) -> wp.vec3d:
    """Moment of a unit impulse along n at a point of a body, in the body's frame [m]."""
    return wp.cross(arm, wp.quat_rotate_inv(q, n))


@wp.func
def lightness(
    b: int, c: int, bodies: RigidBodies, n: wp.vec3d, lever_b: wp.vec3d, m: wp.vec3d, lever_c: wp.vec3d
) -> wp.float64:
    """Speed along n of a point of body b due to a unit impulse along m at a point of body c [1/kg]."""
    if b != c or b < 0:
        return wp.float64(0.0)
    return wp.dot(n, m) / bodies.mass[b] + wp.dot(lever_b, bodies.inverse_inertia[b] * lever_c)


@wp.func
def place_row(r: int, rows: RigidRows, span: wp.float64, poses: Poses, step_out: RigidStep):
    """n and twist at t(n), levers on both bodies, and the speed that closes the opening along n in the step [m/s].

    Rows of joints between whole bodies have their own, see `rigid_joints`.
    """
    if rows.joint[r] >= 0:
        return
    a = rows.first[r]
    b = rows.second[r]
    n = rows.direction[r]
    q = poses.rotation[a]
    apart = poses.centre[a] + turned_by(q) * rows.first_arm[r]
    if b >= 0:
        n = wp.quat_rotate(q, n)
        apart -= poses.centre[b] + turned_by(poses.rotation[b]) * rows.second_arm[r]
        step_out.lever[r, 1] = lever(poses.rotation[b], rows.second_arm[r], n)
    step_out.normal[r] = n
    step_out.twist[r] = wp.quat_rotate(q, rows.twist[r])
    step_out.lever[r, 0] = lever(q, rows.first_arm[r], n) + rows.twist[r]
    step_out.gap[r] = wp.dot(n, apart) / span


@wp.func
def row_lightness(r: int, s: int, bodies: RigidBodies, rows: RigidRows, moves: bool, step: RigidStep) -> wp.float64:
    """Entry of a group's matrix: opening speed of row r due to a unit impulse of row s [1/kg]; 0 for idle pins."""
    if not moves and (rows.pin[r] >= 0 or rows.pin[s] >= 0):
        return wp.float64(0.0)
    a = rows.first[r]
    b = rows.second[r]
    c = rows.first[s]
    d = rows.second[s]
    n = step.normal[r]
    m = step.normal[s]
    found = lightness(a, c, bodies, n, step.lever[r, 0], m, step.lever[s, 0])
    found -= lightness(a, d, bodies, n, step.lever[r, 0], m, step.lever[s, 1])
    found -= lightness(b, c, bodies, n, step.lever[r, 1], m, step.lever[s, 0])
    found += lightness(b, d, bodies, n, step.lever[r, 1], m, step.lever[s, 1])
    if rows.pin[r] >= 0 and rows.pin[r] == rows.pin[s]:
        found += pin_lightness(step.mean[rows.pin[r]], n, step.twist[r], m, step.twist[s])
    return found


@wp.func
def opening(
    begin: int,
    end: int,
    span: wp.float64,
    moves: bool,
    rows: RigidRows,
    clusters: Clusters,
    poses: Poses,
    step_out: RigidStep,
) -> wp.float64:
    """Negative speeds at which rows would open by t(n+1) [m/s], and the greatest; directions open in rad/s.

    Those of joints between whole bodies are known already.
    """
    worst = wp.float64(0.0)
    for r in range(begin, end):
        if rows.joint[r] < 0:
            a = rows.first[r]
            b = rows.second[r]
            v = step_out.velocity[a] + step_out.rate[a] * rows.first_arm[r]
            if b >= 0:
                v -= step_out.velocity[b] + step_out.rate[b] * rows.second_arm[r]
            n = step_out.normal[r]
            speed = wp.dot(n, v) + step_out.gap[r]
            p = rows.pin[r]
            if p >= 0:
                axis = clusters.axis[p]
                d = wp.quat_rotate(poses.rotation[a], axis) + span * (step_out.rate[a] * axis)
                off = wp.dot(step_out.twist[r], wp.cross(step_out.axis[p], d)) - wp.dot(n, step_out.place[p])
                speed += off / span
                if not moves:
                    speed = wp.float64(0.0)
            step_out.value[r] = -speed
        worst = wp.max(worst, wp.abs(step_out.value[r]))
    return worst


@wp.func
def give_impulse(
    r: int,
    size: wp.float64,
    counts: bool,
    rows: RigidRows,
    poses_out: Poses,
    impulse_out: wp.array(dtype=wp.vec3d),
    step_out: RigidStep,
):
    """Apply an impulse of row r to its bodies and to the cluster of its pin."""
    a = rows.first[r]
    b = rows.second[r]
    J = size * step_out.normal[r]
    poses_out.momentum[a] = poses_out.momentum[a] + J
    poses_out.spin[a] = poses_out.spin[a] + size * wp.quat_rotate(poses_out.rotation[a], step_out.lever[r, 0])
    if b >= 0:
        poses_out.momentum[b] = poses_out.momentum[b] - J
        poses_out.spin[b] = poses_out.spin[b] - size * wp.quat_rotate(poses_out.rotation[b], step_out.lever[r, 1])
    if counts and rows.pair[r] >= 0:
        impulse_out[rows.pair[r]] = impulse_out[rows.pair[r]] + rows.sign[r] * J
    p = rows.pin[r]
    if p >= 0:
        step_out.impulse[p, 0] = step_out.impulse[p, 0] - J
        step_out.impulse[p, 1] = step_out.impulse[p, 1] - size * step_out.twist[r]


@wp.func
def give_impulses(
    begin: int,
    end: int,
    counts: bool,
    rows: RigidRows,
    poses_out: Poses,
    impulse_out: wp.array(dtype=wp.vec3d),
    step_out: RigidStep,
):
    """Apply the impulses of rows to their bodies and to clusters of pins, equal and opposite at the common point."""
    for r in range(begin, end):
        size = step_out.value[r]
        if rows.joint[r] >= 0:
            step_out.joints.total[r] = step_out.joints.total[r] + size
        give_impulse(r, size, counts, rows, poses_out, impulse_out, step_out)


@wp.func
def satisfy(
    k: int,
    span: wp.float64,
    counts: bool,
    bodies: RigidBodies,
    rows: RigidRows,
    clusters: Clusters,
    poses_out: Poses,
    impulse_out: wp.array(dtype=wp.vec3d),
    step_out: RigidStep,
):
    """Close the rows of group k, whose bodies moved without them, until only rounding opens them.

    `counts` is false before the first step: then impulses are not counted, and pins do not act.
    """
    begin = rows.begin[k]
    end = rows.begin[k + 1]
    best = wp.float64(0.0)
    for step in range(SOLVES):
        for p in range(rows.pins[k], rows.pins[k + 1]):
            move_pin(p, clusters, span, poses_out, step_out)
        worst = opening(begin, end, span, counts, rows, clusters, poses_out, step_out)
        if worst == wp.float64(0.0) or (step > 0 and worst >= best):
            break
        best = worst
        solve_factorised(rows.entry[k], end - begin, begin, step_out.matrix, step_out.value)
        give_impulses(begin, end, counts, rows, poses_out, impulse_out, step_out)
        for place in range(rows.body[k], rows.body[k + 1]):
            find_motion(rows.member[place], bodies, span, poses_out, step_out)
