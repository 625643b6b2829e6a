"""Owns the arrays of joints between whole bodies: what they are, their state, and what a step computes and forgets.

A joint has six rows of `rigid_rows`: wrenches that do no work on its freedoms, then one row for each rate of these.
"""

import warp as wp

from warp_mca.kernels.loads.amplitude import Tables
from warp_mca.kernels.nodes.screws import Twist

HINGE, SLIDE, BALL = range(3)
NO_MOTOR, TORQUE, SERVO, HELD = range(4)
# columns of `RigidJoints.drive`; units are those of `scene.freedoms.Freedom`
STIFFNESS, REST, DAMPING, FRICTION, FRICTION_RATE, ARMATURE, LOW, HIGH, LIMIT_STIFFNESS, LIMIT_DAMPING = range(10)
KP, KV, LEAST, MOST, COLUMNS = range(10, 15)
LOADS = 6  # force and moment of a joint


@wp.struct
class RigidJoints:
    """Joints between whole bodies. Positions are reference ones, from the point of the joint; "of all" closes a list.

    Attributes:
        begin: first entry in `member` of each group of bodies, and the number of all, shape (group_count + 1,), int32.
        member: joints, group by group, shape (joint_count,), int32.
        body, other: bodies of each joint, -1 where that is a cluster or the ground, shape (joint_count,), int32.
        pin: cluster that stands for one of them, or -1, shape (joint_count,), int32.
        soft: 1 where that is the body, 0 where it is the other one, shape (joint_count,), int32.
        arm, other_arm: point of the joint from the mass centres of both [m], shape (joint_count,), vec3d.
        row: first row of each joint, shape (joint_count,), int32.
        length: by which rotations become ways [m], shape (joint_count,), float64.
        turned, moved: pose of the body on its freedoms at the start, shape (joint_count,), quatd and vec3d [m].
        rate: first rate of each joint, and the number of all, shape (joint_count + 1,), int32.
        kind: HINGE, SLIDE or BALL, of each rate, shape (rate_count,), int32.
        part: 0, 1, 2 of the three rates of a ball, else 0, shape (rate_count,), int32.
        axis: unit vector of each rate where all positions are 0 [-], shape (rate_count,), vec3d.
        point: of its axis there [m], shape (rate_count,), vec3d.
        motor: NO_MOTOR, TORQUE, SERVO or HELD, of each rate, shape (rate_count,), int32.
        drive: its columns as above, shape (rate_count, COLUMNS), float64.
        tables: torques or targets of each rate.
        rounding: opening that rounding leaves [m].
    """

    begin: wp.array(dtype=wp.int32)
    member: wp.array(dtype=wp.int32)
    body: wp.array(dtype=wp.int32)
    other: wp.array(dtype=wp.int32)
    pin: wp.array(dtype=wp.int32)
    soft: wp.array(dtype=wp.int32)
    arm: wp.array(dtype=wp.vec3d)
    other_arm: wp.array(dtype=wp.vec3d)
    row: wp.array(dtype=wp.int32)
    length: wp.array(dtype=wp.float64)
    turned: wp.array(dtype=wp.quatd)
    moved: wp.array(dtype=wp.vec3d)
    rate: wp.array(dtype=wp.int32)
    kind: wp.array(dtype=wp.int32)
    part: wp.array(dtype=wp.int32)
    axis: wp.array(dtype=wp.vec3d)
    point: wp.array(dtype=wp.vec3d)
    motor: wp.array(dtype=wp.int32)
    drive: wp.array2d(dtype=wp.float64)
    tables: Tables
    rounding: wp.float64


@wp.struct
class JointPoses:
    """State of the joints, see `physics.rigid.joint_state.JointState`.

    Attributes:
        position: q of each rate at t(n) [rad], [m], shape (rate_count,), float64.
        rate: its rate at the latest half step [rad/s], [m/s], shape (rate_count,), float64.
        ball: rotation of a ball at t(n), of the first of its rates, shape (rate_count,), quatd.
        work, heat: of motors, and of friction and dampers, half a step after t(n) [J], shape (rate_count,), float64.
        impulse: of force and moment of each joint so far [N s], [N m s], shape (LOADS joint_count,), float64.
        drive: of the motor of each rate so far [N m s], [N s], shape (rate_count,), float64.
        clock: steps that each joint has taken [-], shape (joint_count,), int32.
        held: torque of each motor that is HELD [N m], [N], shape (rate_count,), float64.
        alone: least part of a rate's screw that others do not make, and its step [-], shape (joint_count,), vec2d.
        rank: of a group's rows, at its first joint, see there [-], shape (joint_count,), vec4d.
    """

    position: wp.array(dtype=wp.float64)
    rate: wp.array(dtype=wp.float64)
    ball: wp.array(dtype=wp.quatd)
    work: wp.array(dtype=wp.float64)
    heat: wp.array(dtype=wp.float64)
    impulse: wp.array(dtype=wp.float64)
    drive: wp.array(dtype=wp.float64)
    clock: wp.array(dtype=wp.int32)
    held: wp.array(dtype=wp.float64)
    alone: wp.array(dtype=wp.vec2d)
    rank: wp.array(dtype=wp.vec4d)


@wp.struct
class JointStep:
    """What a step of the joints computes and forgets.

    Attributes:
        screw: twist of each rate at t(n), in the frame of the body, shape (rate_count,), Twist.
        basis: six orthonormal twists of each joint: of its rates, then wrenches that do no work on them, shape
            (6 joint_count,), Twist.
        dual: wrenches that do work on one rate alone, shape (rate_count,), Twist.
        change: of each position in the step [rad], [m], shape (rate_count,), float64.
        push: impulse of each row that does not depend on rates after it [N s], shape (row_count,), float64.
        total: other impulse of each row [N s], shape (row_count,), float64.
        ahead, behind: what a rate after and before the step takes from and gives to this impulse, such as a rotor's
            inertia [kg m^2], [kg], shape (rate_count,), float64.
        torque: of the motor without that of kv [N m], [N], shape (rate_count,), float64.
        drag, hold: viscous factors of friction and dampers, and of the motor [N m s], [N s/m], shape (rate_count,),
            float64.
        worst: greatest opening of each group [m/s], shape (group_count,), float64.
        work, heat, kinetic, stored: energies at t(n) [J], shape (rate_count,), float64.
        load, effort, seen: impulse, drive and position at t(n), as in `JointPoses`.
        pace: rate at t(n), the mean of both half steps around it [rad/s], [m/s], shape (rate_count,), float64.
    """

    screw: wp.array(dtype=Twist)
    basis: wp.array(dtype=Twist)
    dual: wp.array(dtype=Twist)
    change: wp.array(dtype=wp.float64)
    push: wp.array(dtype=wp.float64)
    total: wp.array(dtype=wp.float64)
    ahead: wp.array(dtype=wp.float64)
    behind: wp.array(dtype=wp.float64)
    torque: wp.array(dtype=wp.float64)
    drag: wp.array(dtype=wp.float64)
    hold: wp.array(dtype=wp.float64)
    worst: wp.array(dtype=wp.float64)
    work: wp.array(dtype=wp.float64)
    heat: wp.array(dtype=wp.float64)
    kinetic: wp.array(dtype=wp.float64)
    stored: wp.array(dtype=wp.float64)
    load: wp.array(dtype=wp.float64)
    effort: wp.array(dtype=wp.float64)
    seen: wp.array(dtype=wp.float64)
    pace: wp.array(dtype=wp.float64)
