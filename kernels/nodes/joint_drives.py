"""Owns what acts in the freedoms of joints: springs, dampers, friction, limits, motors, and the inertia of rotors.

With the torque T at t(n) of springs and motors, the factor c of all that is viscous, and the inertia A of the rotor,
the impulse on a freedom, whose rate goes from q'(n-1/2) to q'(n+1/2), is

    y = dt T - dt c (q'(n-1/2) + q'(n+1/2)) / 2 - A (q'(n+1/2) - q'(n-1/2)).

dt T acts before all rows; the rest is the impulse z of the row of this rate,

    q'(n+1/2) + z / (A + dt c / 2) = q'(n-1/2) (A - dt c / 2) / (A + dt c / 2),

which is solved with all rows: dampers are stable in steps of any length, and rotors move as the joint does. Friction
f tanh(q' / v) counts as viscous with the factor f tanh(|q'| / v) / |q'| of the latest rate. A motor at its limit is a
torque; else kv is viscous, too.
"""

import warp as wp

from warp_mca.kernels.loads.amplitude import mean_of_step, value_at
from warp_mca.kernels.nodes.joint_arrays import (
    ARMATURE,
    BALL,
    DAMPING,
    FRICTION,
    FRICTION_RATE,
    HELD,
    HIGH,
    KP,
    KV,
    LEAST,
    LIMIT_DAMPING,
    LIMIT_STIFFNESS,
    LOADS,
    LOW,
    MOST,
    REST,
    SERVO,
    STIFFNESS,
    TORQUE,
    JointPoses,
    JointStep,
    RigidJoints,
)
from warp_mca.kernels.nodes.screws import Twist, moving, turning


@wp.func
def beyond(e: int, q: wp.float64, joints: RigidJoints) -> wp.float64:
    """How far a position is above its upper limit, or, negative, below its lower one [rad], [m]."""
    low = joints.drive[e, wp.static(LOW)]
    high = joints.drive[e, wp.static(HIGH)]
    return wp.max(q - high, wp.float64(0.0)) + wp.min(q - low, wp.float64(0.0))


@wp.func
def spring_way(e: int, q: wp.float64, joints: RigidJoints, state: JointPoses) -> wp.float64:
    """How far a position is from where its spring rests [rad], [m]; of a ball a component of its rotation vector."""
    if joints.kind[e] != wp.static(BALL):
        return q - joints.drive[e, wp.static(REST)]
    first = e - joints.part[e]
    r = wp.vec3d(
        joints.drive[first, wp.static(REST)],
        joints.drive[first + 1, wp.static(REST)],
        joints.drive[first + 2, wp.static(REST)],
    )
    half = wp.float64(0.5) * wp.length(r)
    s = wp.sin(half) * wp.normalize(r)
    x = wp.quat_inverse(wp.quatd(s[0], s[1], s[2], wp.cos(half))) * state.ball[first]
    v = wp.vec3d(x[0], x[1], x[2])
    sine = wp.length(v)
    w = wp.abs(x[3])
    scale = wp.float64(2.0)
    if sine > wp.float64(1e-9):
        scale = wp.float64(2.0) * wp.atan2(sine, w) / sine
    if x[3] < wp.float64(0.0):
        scale = -scale
    return scale * v[joints.part[e]]


@wp.func
def friction_factor(e: int, rate: wp.float64, joints: RigidJoints) -> wp.float64:
    """Viscous factor that friction has at a rate [N m s], [N s/m]."""
    f = joints.drive[e, wp.static(FRICTION)]
    v = joints.drive[e, wp.static(FRICTION_RATE)]
    x = wp.abs(rate) / v
    if x < wp.float64(1e-4):
        return f / v
    return f * wp.tanh(x) / (x * v)


@wp.func
def drive_rate(
    e: int, clock: int, dt: wp.float64, moves: bool, joints: RigidJoints, state: JointPoses, step_out: JointStep
):
    """Torque and viscous factor of the motor of a rate at t(n)."""
    step_out.torque[e] = wp.float64(0.0)
    step_out.hold[e] = wp.float64(0.0)
    if joints.motor[e] == wp.static(TORQUE):
        step_out.torque[e] = mean_of_step(joints.tables, e, clock, dt, not moves)
    if joints.motor[e] == wp.static(HELD):
        step_out.torque[e] = state.held[e]
    if joints.motor[e] == wp.static(SERVO):
        target = value_at(joints.tables, e, dt * wp.float64(clock))
        T = joints.drive[e, wp.static(KP)] * (target - state.position[e])
        kv = joints.drive[e, wp.static(KV)]
        wanted = T - kv * state.rate[e]
        least = joints.drive[e, wp.static(LEAST)]
        most = joints.drive[e, wp.static(MOST)]
        if wanted > least and wanted < most:
            step_out.torque[e] = T
            step_out.hold[e] = kv
        else:
            step_out.torque[e] = wp.clamp(wanted, least, most)


@wp.func
def push_joint(
    j: int, kick: wp.float64, dt: wp.float64, moves: bool, joints: RigidJoints, state: JointPoses, step_out: JointStep
):
    """Impulses of a joint that do not depend on the rates after the step, and what does in `ahead` and `behind`."""
    half = wp.float64(0.5)
    begin = joints.rate[j]
    held = 6 - (joints.rate[j + 1] - begin)
    for i in range(6):
        r = joints.row[j] + i
        step_out.total[r] = wp.float64(0.0)
        step_out.push[r] = wp.float64(0.0)
        if i >= held:
            e = begin + i - held
            q = state.position[e]
            rate = state.rate[e]
            k = joints.drive[e, wp.static(STIFFNESS)]
            x = spring_way(e, q, joints, state)
            over = beyond(e, q, joints)
            k_over = joints.drive[e, wp.static(LIMIT_STIFFNESS)]
            drive_rate(e, state.clock[j], dt, moves, joints, state, step_out)
            drag = joints.drive[e, wp.static(DAMPING)] + friction_factor(e, rate, joints)
            if over != wp.float64(0.0):
                drag += joints.drive[e, wp.static(LIMIT_DAMPING)]
            step_out.drag[e] = drag
            step_out.stored[e] = half * (k * x * x + k_over * over * over)
            push = kick * (step_out.torque[e] - k * x - k_over * over)
            c = drag + step_out.hold[e]
            A = joints.drive[e, wp.static(ARMATURE)]
            if moves:
                step_out.ahead[e] = A + half * kick * c
                step_out.behind[e] = A - half * kick * c
            else:  # half a step back, where a damper would drive
                push -= kick * c * rate
                step_out.ahead[e] = A
                step_out.behind[e] = A
            step_out.push[r] = push


@wp.func
def count_loads(j: int, Q: wp.quatd, joints: RigidJoints, state_out: JointPoses, step_out: JointStep):
    """Impulses of force and moment on a joint's body, which has turned by Q: up to t(n), and what goes on."""
    begin = joints.rate[j]
    count = joints.rate[j + 1] - begin
    given = Twist()
    for i in range(6):
        r = joints.row[j] + i
        wrench = step_out.basis[6 * j + (count + i) % 6]
        if i >= 6 - count:
            wrench = step_out.dual[begin + i - (6 - count)]
        given += (step_out.total[r] + step_out.push[r]) * wrench
    force = wp.quat_rotate(Q, moving(given))
    moment = wp.quat_rotate(Q, joints.length[j] * turning(given))
    for c in range(3):
        first = wp.static(LOADS) * j + c
        step_out.load[first] = state_out.impulse[first] + wp.float64(0.5) * force[c]
        step_out.load[first + 3] = state_out.impulse[first + 3] + wp.float64(0.5) * moment[c]
        state_out.impulse[first] = state_out.impulse[first] + force[c]
        state_out.impulse[first + 3] = state_out.impulse[first + 3] + moment[c]


@wp.func
def count_rates(j: int, span: wp.float64, joints: RigidJoints, state_out: JointPoses, step_out: JointStep):
    """Energies at t(n), works and heat up to then and half a step later; positions and rates move on."""
    half = wp.float64(0.5)
    for e in range(joints.rate[j], joints.rate[j + 1]):
        before = state_out.rate[e]
        after = step_out.change[e] / span
        mean = half * (before + after)
        y = span * (step_out.torque[e] - step_out.hold[e] * mean)
        lost = span * step_out.drag[e] * mean
        step_out.kinetic[e] = half * joints.drive[e, wp.static(ARMATURE)] * before * after
        step_out.work[e] = state_out.work[e] + half * y * before
        step_out.heat[e] = state_out.heat[e] + half * lost * before
        step_out.effort[e] = state_out.drive[e] + half * y
        step_out.seen[e] = state_out.position[e]
        step_out.pace[e] = mean
        state_out.work[e] = step_out.work[e] + half * y * after
        state_out.heat[e] = step_out.heat[e] + half * lost * after
        state_out.drive[e] = state_out.drive[e] + y
        state_out.rate[e] = after
        if joints.kind[e] == wp.static(BALL) and joints.part[e] == 0:
            c = half * wp.vec3d(step_out.change[e], step_out.change[e + 1], step_out.change[e + 2])
            turn = wp.normalize(wp.quatd(c[0], c[1], c[2], wp.float64(1.0)))
            state_out.ball[e] = wp.normalize(state_out.ball[e] * turn)
        state_out.position[e] = state_out.position[e] + step_out.change[e]
    state_out.clock[j] = state_out.clock[j] + 1
