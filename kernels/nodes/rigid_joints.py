"""Owns joints between whole bodies: their poses by products of exponentials, and the rows that hold them.

With the motions T_a, T_b of both bodies since the start, their relative pose is h = T_b^-1 T_a. That of the freedoms
with positions q is, as in Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation (1994), chapter 3,

    h(q) = E(q_0)^-1 E(q),   E(q) = exp(S_1 q_1) exp(S_2 q_2) ...

with the screws S where all positions are 0. In the frame of the body, q_k moves it by the twist B_k(q). At t(n) the
wrenches W_i that do no work on all B_k are the directions of impulses that hold the joint; with the wrenches F_k that
do work on B_k alone, they span all six. At t(n+1) the small twist e of E(q)^-1 E(q_0) h must vanish: q changes by
F . e, and what is left opens the rows by W . e, which impulses close, see `rigid_rows`. Both find h(q) exactly, so that
nothing drifts. Rows of the rates hold what depends on these after the step, see `joint_drives`.
"""

import warp as wp

from warp_mca.kernels.nodes.cluster import spin_after
from warp_mca.kernels.nodes.coupling import turned
from warp_mca.kernels.nodes.joint_arrays import BALL, SLIDE, JointPoses, JointStep, RigidJoints
from warp_mca.kernels.nodes.rigid_motion import Poses, RigidBodies, RigidStep, turned_by
from warp_mca.kernels.nodes.screws import (
    Pose,
    Twist,
    moving,
    pose_of,
    screw_before,
    seen_from,
    small_twist,
    then,
    turned_about,
    turning,
    twist_of,
)

SOLVES = 2  # changes of q in each step of Newton's method
DEPENDENT = 1e-6  # share of a screw that must be left of it by others


@wp.func
def freedom_pose(e: int, joints: RigidJoints, state: JointPoses, step: JointStep) -> Pose:
    """Motion by the freedom whose first rate is e."""
    half = wp.float64(0.5)
    if joints.kind[e] == wp.static(BALL):
        c = half * wp.vec3d(step.change[e], step.change[e + 1], step.change[e + 2])
        q = state.ball[e] * wp.normalize(wp.quatd(c[0], c[1], c[2], wp.float64(1.0)))
        return turned_about(wp.normalize(q), joints.point[e])
    value = state.position[e] + step.change[e]
    if joints.kind[e] == wp.static(SLIDE):
        return pose_of(wp.quat_identity(dtype=wp.float64), value * joints.axis[e])
    s = wp.sin(half * value) * joints.axis[e]
    return turned_about(wp.quatd(s[0], s[1], s[2], wp.cos(half * value)), joints.point[e])


@wp.func
def joint_pose(j: int, joints: RigidJoints, state: JointPoses, step: JointStep) -> Pose:
    """E(q)."""
    found = pose_of(wp.quat_identity(dtype=wp.float64), wp.vec3d())
    for e in range(joints.rate[j], joints.rate[j + 1]):
        if joints.part[e] == 0:
            found = then(found, freedom_pose(e, joints, state, step))
    return found


@wp.func
def place_screws(j: int, joints: RigidJoints, state: JointPoses, step_out: JointStep):
    """B of each rate at t(n)."""
    begin = joints.rate[j]
    end = joints.rate[j + 1]
    tail = pose_of(wp.quat_identity(dtype=wp.float64), wp.vec3d())
    for e in range(begin, end):
        step_out.change[e] = wp.float64(0.0)
    for back in range(end - begin):
        e = end - 1 - back
        axis = joints.axis[e]
        if joints.kind[e] == wp.static(SLIDE):
            step_out.screw[e] = screw_before(wp.vec3d(), axis, tail, joints.length[j])
        else:
            step_out.screw[e] = screw_before(axis, wp.cross(joints.point[e], axis), tail, joints.length[j])
        if joints.part[e] == 0:
            tail = then(freedom_pose(e, joints, state, step_out), tail)


@wp.func
def left_of(x: Twist, begin: int, end: int, basis: wp.array(dtype=Twist)) -> Twist:
    """What is left of x across some orthonormal twists; twice, so that rounding does not stay."""
    found = x
    for _ in range(2):
        for k in range(begin, end):
            found -= wp.dot(found, basis[k]) * basis[k]
    return found


@wp.func
def split_motions(j: int, joints: RigidJoints, step_out: JointStep) -> wp.float64:
    """Orthonormal basis of B and W (Gram and Schmidt), and F; returns the least part of a screw that others leave."""
    alone = wp.float64(1.0)
    first = 6 * j
    begin = joints.rate[j]
    count = joints.rate[j + 1] - begin
    for k in range(count):
        x = step_out.screw[begin + k]
        left = left_of(x, first, first + k, step_out.basis)
        size = wp.length(left)
        alone = wp.min(alone, size / wp.length(x))
        if size > wp.float64(DEPENDENT) * wp.length(x):
            step_out.basis[first + k] = left / size
        else:
            step_out.basis[first + k] = Twist()
    for k in range(count, 6):
        best = int(0)
        most = wp.float64(-1.0)
        for c in range(6):
            left_square = wp.float64(1.0)
            for i in range(first, first + k):
                left_square -= step_out.basis[i][c] * step_out.basis[i][c]
            if left_square > most + wp.float64(1e-9):
                most = left_square
                best = c
        unit = Twist()
        unit[best] = wp.float64(1.0)
        step_out.basis[first + k] = wp.normalize(left_of(unit, first, first + k, step_out.basis))
    for e in range(count):
        # with B = U R, orthonormal U and triangular R: F = U R^-T
        y = Twist()
        found = Twist()
        for k in range(count):
            value = wp.float64(0.0)
            if k == e:
                value = wp.float64(1.0)
            for i in range(k):
                value -= wp.dot(step_out.basis[first + i], step_out.screw[begin + k]) * y[i]
            size = wp.dot(step_out.basis[first + k], step_out.screw[begin + k])
            if size > wp.float64(0.0):
                y[k] = value / size
                found += y[k] * step_out.basis[first + k]
        step_out.dual[begin + e] = found
    return alone


@wp.func
def rigid_pose(b: int, arm: wp.vec3d, poses: Poses) -> Pose:
    """Motion of a body since the start at t(n), as that of a point at an arm [m]; none of the ground."""
    if b < 0:
        return pose_of(wp.quat_identity(dtype=wp.float64), wp.vec3d())
    return pose_of(poses.rotation[b], poses.centre[b] + turned_by(poses.rotation[b]) * arm)


@wp.func
def pose_after(b: int, arm: wp.vec3d, span: wp.float64, poses: Poses, step: RigidStep) -> Pose:
    """The same at t(n+1)."""
    if b < 0:
        return pose_of(wp.quat_identity(dtype=wp.float64), wp.vec3d())
    q = poses.rotation[b]
    f = step.turn[b]
    way = step.velocity[b] + step.rate[b] * arm
    place = poses.centre[b] + turned_by(q) * arm + span * way
    return pose_of(wp.normalize(q * wp.quatd(f[0], f[1], f[2], wp.float64(1.0))), place)


@wp.func
def motion_of(b: int, arm: wp.vec3d, bodies: RigidBodies, poses: Poses) -> Twist:
    """Angular velocity of a body and velocity of a point at an arm [rad/s], [m/s]; none of the ground."""
    if b < 0:
        return Twist()
    q = poses.rotation[b]
    w = wp.quat_rotate(q, bodies.inverse_inertia[b] * wp.quat_rotate_inv(q, poses.spin[b]))
    v = poses.momentum[b] / bodies.mass[b] + wp.cross(w, wp.quat_rotate(q, arm))
    return twist_of(w, v, wp.float64(1.0))


@wp.func
def start_rates(
    j: int, Q: wp.quatd, apart: wp.vec3d, joints: RigidJoints, bodies: RigidBodies, poses_out: Poses, step: RigidStep
):
    """Rates at t = 0 of the freedoms of a joint, whose body has turned by Q and whose points are `apart` [m]."""
    a = motion_of(joints.body[j], joints.arm[j], bodies, poses_out)
    b = motion_of(joints.other[j], joints.other_arm[j], bodies, poses_out)
    p = joints.pin[j]
    if p >= 0:
        m = step.mean[p]
        soft = twist_of(m.spin, m.velocity + wp.cross(m.spin, step.point[p] - m.centre), wp.float64(1.0))
        if joints.soft[j] == 1:
            a = soft
        else:
            b = soft
    v = moving(a) - moving(b) - wp.cross(turning(b), apart)
    w = wp.quat_rotate_inv(Q, turning(a) - turning(b))
    relative = twist_of(w, wp.quat_rotate_inv(Q, v), joints.length[j])
    for e in range(joints.rate[j], joints.rate[j + 1]):
        poses_out.joints.rate[e] = wp.dot(step.joints.dual[e], relative)


@wp.func
def place_wrench(
    r: int, wrench: Twist, j: int, Q: wp.quatd, apart: wp.vec3d, joints: RigidJoints, poses: Poses, step_out: RigidStep
):
    """Row r of a wrench in the frame of a joint's body: its direction, and its levers on both sides."""
    n = wp.quat_rotate(Q, moving(wrench))
    t = wp.quat_rotate(Q, joints.length[j] * turning(wrench))
    b = joints.other[j]
    other = apart
    if b >= 0:
        other += wp.quat_rotate(poses.rotation[b], joints.other_arm[j])
    if joints.soft[j] == 1:  # the row's first body is the other one, which takes the wrench reversed
        step_out.normal[r] = -n
        step_out.twist[r] = -t
        step_out.lever[r, 0] = -wp.quat_rotate_inv(poses.rotation[b], wp.cross(other, n) + t)
        return
    step_out.normal[r] = n
    step_out.twist[r] = t + wp.cross(other, n)
    step_out.lever[r, 0] = wp.quat_rotate_inv(Q, wp.cross(wp.quat_rotate(Q, joints.arm[j]), n) + t)
    if b >= 0:
        step_out.lever[r, 1] = wp.quat_rotate_inv(poses.rotation[b], wp.cross(other, n) + t)


@wp.func
def place_joint(
    j: int,
    span: wp.float64,
    moves: bool,
    joints: RigidJoints,
    bodies: RigidBodies,
    poses_out: Poses,
    step_out: RigidStep,
):
    """Rows of a joint at t(n): wrenches that hold it, then those that do work on one rate each."""
    place_screws(j, joints, poses_out.joints, step_out.joints)
    alone = split_motions(j, joints, step_out.joints)
    if moves and alone < poses_out.joints.alone[j][0]:
        poses_out.joints.alone[j] = wp.vec2d(alone, wp.float64(poses_out.joints.clock[j]))
    a = rigid_pose(joints.body[j], joints.arm[j], poses_out)
    b = rigid_pose(joints.other[j], joints.other_arm[j], poses_out)
    p = joints.pin[j]
    if p >= 0:
        soft = pose_of(poses_out.orientation[p], step_out.point[p])
        if joints.soft[j] == 1:
            a = soft
        else:
            b = soft
    begin = joints.rate[j]
    count = joints.rate[j + 1] - begin
    for i in range(6):
        wrench = step_out.joints.basis[6 * j + (count + i) % 6]
        if i >= 6 - count:
            wrench = step_out.joints.dual[begin + i - (6 - count)]
        place_wrench(joints.row[j] + i, wrench, j, a.rotation, a.place - b.place, joints, poses_out, step_out)
    if not moves:
        start_rates(j, a.rotation, a.place - b.place, joints, bodies, poses_out, step_out)
    for e in range(begin, begin + count):
        step_out.joints.change[e] = span * poses_out.joints.rate[e]


@wp.func
def close_joint(j: int, span: wp.float64, moves: bool, joints: RigidJoints, poses: Poses, step_out: RigidStep):
    """Change of the positions up to t(n+1), and the negative speeds at which the rows of a joint open by then."""
    a = pose_after(joints.body[j], joints.arm[j], span, poses, step_out)
    b = pose_after(joints.other[j], joints.other_arm[j], span, poses, step_out)
    p = joints.pin[j]
    if p >= 0:
        m = step_out.mean[p]
        w = spin_after(m, m.spin, step_out.impulse[p, 0], step_out.impulse[p, 1])
        soft = pose_of(turned(poses.orientation[p], span * w), step_out.place[p])
        if joints.soft[j] == 1:
            a = soft
        else:
            b = soft
    relative = then(pose_of(joints.turned[j], joints.moved[j]), seen_from(b, a))
    begin = joints.rate[j]
    end = joints.rate[j + 1]
    off = Twist()
    for solve in range(wp.static(SOLVES + 1)):
        found = seen_from(joint_pose(j, joints, poses.joints, step_out.joints), relative)
        off = small_twist(found, joints.length[j])
        if solve < wp.static(SOLVES):
            for e in range(begin, end):
                change = step_out.joints.change[e] + wp.dot(step_out.joints.dual[e], off)
                step_out.joints.change[e] = change
    count = end - begin
    for i in range(6):
        r = joints.row[j] + i
        speed = wp.float64(0.0)
        if i < 6 - count:
            speed = wp.dot(step_out.joints.basis[6 * j + count + i], off) / span
        else:
            e = begin + i - (6 - count)
            ahead = step_out.joints.ahead[e]
            if ahead > wp.float64(0.0):
                given = step_out.joints.total[r] - step_out.joints.behind[e] * poses.joints.rate[e]
                speed = step_out.joints.change[e] / span + given / ahead
        if p >= 0 and not moves:
            speed = wp.float64(0.0)
        step_out.value[r] = -speed
