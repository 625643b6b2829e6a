"""Owns poses and twists: pure functions of rigid motions, of which joints of rigid bodies are made.

A pose takes y to R y + p. A twist is (length times angular velocity, velocity of the point at the origin), so that all
six entries are speeds; a wrench is (moment at the origin over length, force).
"""

import warp as wp

Twist = wp.types.vector(length=6, dtype=wp.float64)


@wp.struct
class Pose:
    """A rigid motion.

    Attributes:
        rotation: R, a unit quaternion [-].
        place: p [m].
    """

    rotation: wp.quatd
    place: wp.vec3d


@wp.func
def pose_of(rotation: wp.quatd, place: wp.vec3d) -> Pose:
    """Both as one."""
    found = Pose()
    found.rotation = rotation
    found.place = place
    return found


@wp.func
def then(outer: Pose, inner: Pose) -> Pose:
    """The pose that `inner`, and after it `outer`, gives."""
    return pose_of(outer.rotation * inner.rotation, outer.place + wp.quat_rotate(outer.rotation, inner.place))


@wp.func
def seen_from(a: Pose, b: Pose) -> Pose:
    """b as the frame sees it that has moved by a: the inverse of a after b."""
    return pose_of(wp.quat_inverse(a.rotation) * b.rotation, wp.quat_rotate_inv(a.rotation, b.place - a.place))


@wp.func
def turned_about(q: wp.quatd, point: wp.vec3d) -> Pose:
    """Rotation by q about a point."""
    return pose_of(q, point - wp.quat_rotate(q, point))


@wp.func
def twist_of(angular: wp.vec3d, velocity: wp.vec3d, length: wp.float64) -> Twist:
    """A twist of its parts [rad/s], [m/s]."""
    return Twist(length * angular[0], length * angular[1], length * angular[2], velocity[0], velocity[1], velocity[2])


@wp.func
def small_twist(pose: Pose, length: wp.float64) -> Twist:
    """Twist that leads to a pose near that of rest, to first order [m]."""
    q = pose.rotation
    half = wp.float64(2.0)
    if q[3] < wp.float64(0.0):
        half = wp.float64(-2.0)
    return twist_of(half * wp.vec3d(q[0], q[1], q[2]), pose.place, length)


@wp.func
def turning(twist: Twist) -> wp.vec3d:
    """First part of a twist or wrench, with the factor length or over it."""
    return wp.vec3d(twist[0], twist[1], twist[2])


@wp.func
def moving(twist: Twist) -> wp.vec3d:
    """Velocity of a twist at the origin [m/s], or force of a wrench [N]."""
    return wp.vec3d(twist[3], twist[4], twist[5])


@wp.func
def screw_before(angular: wp.vec3d, velocity: wp.vec3d, tail: Pose, length: wp.float64) -> Twist:
    """Twist of a freedom that carries `tail`, in the frame that this carries."""
    seen = velocity + wp.cross(angular, tail.place)
    return twist_of(wp.quat_rotate_inv(tail.rotation, angular), wp.quat_rotate_inv(tail.rotation, seen), length)
