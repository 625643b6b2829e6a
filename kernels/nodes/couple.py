"""Owns the step of couplings: blocks of threads sum parts of clusters, then move the nodes of these by the impulses.

`cluster` has the equations. Each block solves for the impulses of its coupling by itself, so that none waits.
"""

import warp as wp

from warp_mca.kernels.nodes.base import Bases, base_velocity
from warp_mca.kernels.nodes.cluster import (
    Clusters,
    Mean,
    Sums,
    axis_ahead,
    cluster_sums,
    mean_motion,
    point_ahead,
    pull,
    spin_after,
)
from warp_mca.kernels.nodes.coupling import Inverse, inverse_of, joint_impulses, sum_of, turned

wp.set_module_options({"enable_backward": False})


@wp.func
def ground_motion(
    j: int,
    clusters: Clusters,
    bases: Bases,
    carriage: wp.array(dtype=wp.vec3d),
    clock: wp.array(dtype=wp.int32),
    dt: wp.float64,
) -> Mean:
    """Motion of the ground or the base that joint j hangs on, without the joint's impulse."""
    found = Mean()
    if clusters.base.shape[0] > 0:
        k = clusters.base[j]
        if k >= 0:
            e = bases.direction[k]
            b = base_velocity(bases, k, (wp.float64(clock[k]) + wp.float64(0.5)) * dt)
            free = carriage[k] + dt * bases.gravity[k]
            found.velocity = b + wp.dot(e, free - b) * e
            if bases.mass[k] > wp.float64(0.0):
                found.response.point = wp.outer(e, e) / bases.mass[k]
    return found


@wp.func
def hinge_inverse(a: Mean, b: Mean, axis: wp.vec3d) -> Inverse:
    """What gives the impulses of a hinge about a unit vector, from the responses of what it joins."""
    held = wp.identity(3, dtype=wp.float64) - wp.outer(axis, axis)
    return inverse_of(sum_of(a.response, b.response), held)


@wp.func
def hinge_impulses(
    j: int, clusters: Clusters, inverse: Inverse, a: Mean, b: Mean, q_a: wp.quatd, q_b: wp.quatd, dt: wp.float64
):
    """J and T on the first cluster that let the points and the axes of both coincide after the step."""
    gap = point_ahead(a, q_a, clusters.arm[j, 0], dt) - point_ahead(b, q_b, clusters.arm[j, 1], dt)
    tilt = wp.cross(axis_ahead(b, q_b, clusters.axis[j], dt), axis_ahead(a, q_a, clusters.axis[j], dt))
    J, T = joint_impulses(inverse, gap / dt, tilt / dt)
    return J, T


@wp.func
def place_after(place: wp.vec3d, P: wp.vec3d, a: Mean, b: Mean, J: wp.vec3d, T: wp.vec3d, dt: wp.float64) -> wp.vec3d:
    """Where a joint at P from its `place` is after the step [m]; the ground or a base, without mass, holds it."""
    if b.mass == wp.float64(0.0):
        return place + dt * (b.velocity - b.response.point * J)
    v = a.velocity + wp.cross(a.spin, P - a.centre) + a.response.point * J + a.response.mixed * T
    return place + P + dt * v


@wp.func
def joint_point(total: Sums, q: wp.quatd, arm: wp.vec3d) -> wp.vec3d:
    """The point P that the first cluster, turned by q, carries, from the origin of its sums [m]."""
    return wp.vec3d(total[1], total[2], total[3]) / total[0] + wp.quat_rotate(q, arm)


@wp.kernel(enable_backward=False)
def sum_parts(
    clusters: Clusters,
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    place: wp.array(dtype=wp.vec3d),
    orientation: wp.array2d(dtype=wp.quatd),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    sums_out: wp.array(dtype=Sums),
    place_out: wp.array(dtype=wp.vec3d),
    orientation_out: wp.array2d(dtype=wp.quatd),
):
    """Sums of each part of the clusters, once `constraint.bound_kernel` has advanced their nodes as free ones.

    A block of threads for each part. place_out and orientation_out take what `couple_parts` then changes.
    """
    part, lane = wp.tid()
    where = clusters.part[part]
    j = where[0]
    total = cluster_sums(where[2], where[3], lane, place[j], clusters, X, mass, u, v, dt)
    if lane == 0:
        sums_out[part] = total
        if part == clusters.first_part[j][0]:
            place_out[j] = place[j]
            for side in range(2):
                orientation_out[j, side] = orientation[j, side]


@wp.func
def sum_of_parts(first: int, end: int, lane: int, sums: wp.array(dtype=Sums)) -> Sums:
    """Sums of a cluster from those of its parts, by a block."""
    total = Sums()
    for k in range(first + lane, end, wp.block_dim()):
        total += sums[k]
    found = wp.tile_sum(wp.tile(total, preserve_type=True))
    return found[0]


@wp.kernel(enable_backward=False)
def couple_parts(
    clusters: Clusters,
    bases: Bases,
    X: wp.array(dtype=wp.vec3d),
    sums: wp.array(dtype=Sums),
    place: wp.array(dtype=wp.vec3d),
    orientation: wp.array2d(dtype=wp.quatd),
    carriage: wp.array(dtype=wp.vec3d),
    clock: wp.array(dtype=wp.int32),
    dt: wp.float64,
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    speed_square_out: wp.array(dtype=wp.float32),
    impulse_out: wp.array(dtype=wp.vec3d),
    place_out: wp.array(dtype=wp.vec3d),
    orientation_out: wp.array2d(dtype=wp.quatd),
    latest_out: wp.array(dtype=wp.vec3d),
):
    """Join the clusters of each coupling, from the sums, places and orientations that `sum_parts` has found.

    A block of threads for each part. impulse_out [N s] sums J at the first node of the first cluster. place_out
    follows the joint, where the ground or a base holds it exactly; orientation_out the mean rotation of both clusters.
    latest_out takes J where some base moves or slides; `bases`, `carriage` and `clock` are as in `base.move_bases`.
    """
    part, lane = wp.tid()
    where = clusters.part[part]
    j = where[0]
    first = clusters.first_part[j]
    q_a = orientation[j, 0]
    q_b = orientation[j, 1]
    total = sum_of_parts(first[0], first[1], lane, sums)
    P = joint_point(total, q_a, clusters.arm[j, 0])
    a = mean_motion(total, P)
    b = ground_motion(j, clusters, bases, carriage, clock, dt)
    if first[2] > first[1]:
        total = sum_of_parts(first[1], first[2], lane, sums)
        b = mean_motion(total, P)
    inverse = hinge_inverse(a, b, wp.quat_rotate(q_a, clusters.axis[j]))
    J, T = hinge_impulses(j, clusters, inverse, a, b, q_a, q_b, dt)
    # fmt: off
    if where[1] == 0:
        pull(
            where[2], where[3], lane, place[j], a, J, wp.cross(P - a.centre, J) + T,
            clusters, X, dt, u_out, v_out, speed_square_out,
        )
    else:
        pull(
            where[2], where[3], lane, place[j], b, -J, -(wp.cross(P - b.centre, J) + T),
            clusters, X, dt, u_out, v_out, speed_square_out,
        )
    # fmt: on
    if part == first[0] and lane == 0:
        if latest_out.shape[0] > 0:
            latest_out[j] = J
        orientation_out[j, 0] = turned(q_a, dt * spin_after(a, J, T))
        orientation_out[j, 1] = turned(q_b, dt * spin_after(b, -J, -T))
        place_out[j] = place_after(place[j], P, a, b, J, T, dt)
        i = clusters.begin[j][0]
        impulse_out[i] = impulse_out[i] + J
