"""Owns the impulses of a hinge with pins between two clusters, or a cluster and the ground: pure functions.

`side_of` and `hinge_inverse` use positions at t(n) and run before the free step; the impulses use the velocities after
it. `cluster` and `coupling` have the equations.
"""

import warp as wp

from warp_mca.kernels.nodes.cluster import Clusters, Mean, Sums, mean_response
from warp_mca.kernels.nodes.coupling import Inverse, inverse_of, joint_impulses, sum_of, turned


@wp.struct
class Side:
    """One side of a hinge at t(n), relative to the place of the joint.

    Attributes:
        mean: position of the cluster and its response; of the ground, response and velocity.
        arm: from the mean position to the joint [m].
        axis: of the hinge, a unit vector [-].
    """

    mean: Mean
    arm: wp.vec3d
    axis: wp.vec3d


@wp.struct
class Ahead:
    """Mean motion after the free step, and the joint as it carries it.

    Attributes:
        velocity: V [m/s].
        spin: w [rad/s].
        point: of the joint at t(n+1) [m].
        axis: of the hinge then [-].
    """

    velocity: wp.vec3d
    spin: wp.vec3d
    point: wp.vec3d
    axis: wp.vec3d


@wp.func
def joint_point(total: Sums, q: wp.quatd, arm: wp.vec3d) -> wp.vec3d:
    """Point P of the first cluster, which has turned by q, relative to the origin of its sums [m]."""
    return wp.vec3d(total[1], total[2], total[3]) / total[0] + wp.quat_rotate(q, arm)


@wp.func
def side_of(j: int, side: int, clusters: Clusters, q: wp.quatd, total: Sums, P: wp.vec3d, ground: Mean) -> Side:
    """One side of coupling j, which has turned by q, from the moments of its cluster if it has one."""
    found = Side()
    found.arm = wp.quat_rotate(q, clusters.arm[j, side])
    found.axis = wp.quat_rotate(q, clusters.axis[j])
    if clusters.begin[j][1 + side] > clusters.begin[j][side]:
        found.mean = mean_response(total, P)
    else:
        found.mean = ground
    return found


@wp.func
def hinge_inverse(a: Mean, b: Mean, axis: wp.vec3d) -> Inverse:
    """Inverse that gives the impulses of a hinge about a unit vector, from the responses of its sides."""
    held = wp.identity(3, dtype=wp.float64) - wp.outer(axis, axis)
    return inverse_of(sum_of(a.response, b.response), held)


@wp.func
def turned_by_little(r: wp.vec3d, angle: wp.vec3d) -> wp.vec3d:
    """A vector after a rotation by a small angle, by its series; the next step corrects the remainder."""
    a = wp.cross(angle, r)
    b = wp.cross(angle, a)
    return r + (a + (wp.float64(0.5) * b + wp.float64(1.0 / 6.0) * wp.cross(angle, b)))


@wp.func
def look_ahead(side: Side, p: wp.vec3d, L: wp.vec3d, dt: wp.float64) -> Ahead:
    """Motion of a side with the momentum p and the angular momentum L about the origin."""
    found = Ahead()
    found.velocity = side.mean.velocity + side.mean.lightness * p
    found.spin = side.mean.inverse * (L - wp.cross(side.mean.centre, p))
    angle = dt * found.spin
    found.point = (side.mean.centre + dt * found.velocity) + turned_by_little(side.arm, angle)
    found.axis = turned_by_little(side.axis, angle)
    return found


@wp.func
def hinge_impulses(inverse: Inverse, a: Ahead, b: Ahead, rate: wp.float64):
    """J and T on the first side that make points and axes of both coincide after the step; `rate` is 1 / dt [1/s]."""
    J, T = joint_impulses(inverse, rate * (a.point - b.point), rate * wp.cross(b.axis, a.axis))
    return J, T


@wp.func
def quickly_turned(q: wp.quatd, angle: wp.vec3d) -> wp.quatd:
    """`turned` for small angles by series, which need neither root nor quotient."""
    h = wp.float64(0.25) * wp.dot(angle, angle)
    if h > wp.float64(1e-6):
        return turned(q, angle)
    sine = wp.float64(0.5) * (wp.float64(1.0) - h * (wp.float64(1.0 / 6.0) - h * wp.float64(1.0 / 120.0)))
    cosine = wp.float64(1.0) - h * (wp.float64(0.5) - h * wp.float64(1.0 / 24.0))
    found = wp.quatd(sine * angle[0], sine * angle[1], sine * angle[2], cosine) * q
    square = found[0] * found[0] + found[1] * found[1] + found[2] * found[2] + found[3] * found[3]
    return (wp.float64(1.5) - wp.float64(0.5) * square) * found


@wp.func
def place_after(
    place: wp.vec3d, P: wp.vec3d, a: Side, b: Mean, first: Ahead, J: wp.vec3d, T: wp.vec3d, dt: wp.float64
) -> wp.vec3d:
    """Place after the step of a joint at P from its `place` [m]; a side without mass, ground or base, holds it."""
    if b.mass == wp.float64(0.0):
        return place + dt * (b.velocity - b.response.point * J)
    v = first.velocity + wp.cross(first.spin, P - a.mean.centre)
    return place + P + dt * (v + a.mean.response.point * J + a.mean.response.mixed * T)
