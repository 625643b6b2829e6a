"""Owns the step of couplings: blocks of threads sum parts of clusters, then move the nodes of these by the impulses.

`cluster` and `hinge` have the equations. Quantities that depend on positions alone are computed beside the forces. Each
block then solves for the impulses of its coupling by itself, so that no block waits for another.
"""

import warp as wp

from warp_mca.kernels.hardware.block import block_sum, wait_for_block
from warp_mca.kernels.nodes.base import Bases, base_velocity
from warp_mca.kernels.nodes.cluster import Clusters, Mean, Sums, arm_before, cluster_sums, pull, spin_after
from warp_mca.kernels.nodes.coupling import Inverse
from warp_mca.kernels.nodes.hinge import (
    Side,
    hinge_impulses,
    hinge_inverse,
    joint_point,
    look_ahead,
    place_after,
    quickly_turned,
    side_of,
)

Momenta = wp.types.vector(length=12, dtype=wp.float64)  # p and L of the first cluster, then of the second


@wp.func
def ground_motion(
    j: int,
    clusters: Clusters,
    bases: Bases,
    carriage: wp.array(dtype=wp.vec3d),
    clock: wp.array(dtype=wp.int32),
    dt: wp.float64,
) -> Mean:
    """Motion of the ground or the base on which joint j hangs, without the joint's impulse."""
    found = Mean()
    if clusters.base.shape[0] > 0:
        k = clusters.base[j]
        if k >= 0:
            e = bases.direction[k]
            b = base_velocity(bases, k, clock[k], dt)
            free = carriage[k] + dt * bases.gravity[k]
            found.velocity = b + wp.dot(e, free - b) * e
            if bases.mass[k] > wp.float64(0.0):
                found.response.point = wp.outer(e, e) / bases.mass[k]
    return found


@wp.kernel(enable_backward=False)
def sum_moments(
    clusters: Clusters,
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    place: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    sums_out: wp.array(dtype=Sums),
):
    """Sum each part of the clusters at t(n); a block of threads takes a part."""
    part, lane = wp.tid()
    where = clusters.part[part]
    total = cluster_sums(where[2], where[3], lane, place[where[0]], clusters, X, mass, u, v, wp.float64(0.0))
    if lane == 0:
        sums_out[part] = total


@wp.func
def sum_of_parts(first: int, end: int, lane: int, sums: wp.array(dtype=Sums)) -> Sums:
    """Add up the sums of a cluster's parts, by a block."""
    total = Sums()
    for k in range(first + lane, end, wp.block_dim()):
        total += sums[k]
    return block_sum(total)


@wp.func
def one_of(side: int, first: Sums, second: Sums) -> Sums:
    """Sums of the first or the second cluster."""
    if side == 0:
        return first
    return second


@wp.kernel(enable_backward=False)
def find_responses(
    clusters: Clusters,
    bases: Bases,
    sums: wp.array(dtype=Sums),
    place: wp.array(dtype=wp.vec3d),
    orientation: wp.array2d(dtype=wp.quatd),
    carriage: wp.array(dtype=wp.vec3d),
    clock: wp.array(dtype=wp.int32),
    dt: wp.float64,
    side_out: wp.array2d(dtype=Side),
    inverse_out: wp.array(dtype=Inverse),
    point_out: wp.array(dtype=wp.vec3d),
    place_out: wp.array(dtype=wp.vec3d),
):
    """Compute what the impulses of each coupling need from positions, by a block of threads.

    point_out is the point P of the joint relative to its place at t(n) [m], which is place_out. `bases`, `carriage` and
    `clock` are as in `base.move_bases`.
    """
    j, lane = wp.tid()
    first = clusters.first_part[j]
    q = orientation[j, 0]
    total = sum_of_parts(first[0], first[1], lane, sums)
    other = sum_of_parts(first[1], first[2], lane, sums)
    P = joint_point(total, q, clusters.arm[j, 0])
    for side in range(lane, 2, wp.block_dim()):
        ground = ground_motion(j, clusters, bases, carriage, clock, dt)
        side_out[j, side] = side_of(j, side, clusters, orientation[j, side], one_of(side, total, other), P, ground)
    wait_for_block()
    if lane == 0:
        inverse_out[j] = hinge_inverse(side_out[j, 0].mean, side_out[j, 1].mean, side_out[j, 0].axis)
        point_out[j] = P
        place_out[j] = place[j]


@wp.kernel(enable_backward=False)
def sum_momenta(
    clusters: Clusters,
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    place: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    momenta_out: wp.array(dtype=Momenta),
):
    """Sum the momenta of each part with arms of t(n), after `constraint.bound_kernel` advanced its nodes as free."""
    part, lane = wp.tid()
    where = clusters.part[part]
    total = Momenta()
    for k in range(where[2] + lane, where[3], wp.block_dim()):
        i = clusters.node[k]
        p = clusters.weight[k] * mass[i] * v[i]
        L = wp.cross(arm_before(i, place[where[0]], dt, X, u, v[i]), p)
        for c in range(3):
            total[c] += p[c]
            total[3 + c] += L[c]
    total = block_sum(total)
    if lane == 0:
        if where[1] == 1:
            for c in range(6):
                total[6 + c] = total[c]
                total[c] = wp.float64(0.0)
        momenta_out[part] = total


@wp.kernel(enable_backward=False)
def couple_parts(
    clusters: Clusters,
    X: wp.array(dtype=wp.vec3d),
    side: wp.array2d(dtype=Side),
    inverse: wp.array(dtype=Inverse),
    point: wp.array(dtype=wp.vec3d),
    place: wp.array(dtype=wp.vec3d),
    momenta: wp.array(dtype=Momenta),
    dt: wp.float64,
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    speed_square_out: wp.array(dtype=wp.float32),
    impulse_out: wp.array(dtype=wp.vec3d),
    place_out: wp.array(dtype=wp.vec3d),
    orientation_out: wp.array2d(dtype=wp.quatd),
    latest_out: wp.array(dtype=wp.vec3d),
):
    """Join the clusters of each coupling; a block of threads takes a part.

    impulse_out [N s] sums J at the first node of the first cluster. place_out follows the joint, where the ground or a
    base holds it exactly; orientation_out the mean rotation of both clusters. latest_out takes J where some base moves
    or slides.
    """
    part, lane = wp.tid()
    where = clusters.part[part]
    j = where[0]
    first = clusters.first_part[j]
    total = Momenta()
    for k in range(first[0] + lane, first[2], wp.block_dim()):
        total += momenta[k]
    total = block_sum(total)
    one = side[j, 0]
    other = side[j, 1]
    P = point[j]
    a = look_ahead(one, wp.vec3d(total[0], total[1], total[2]), wp.vec3d(total[3], total[4], total[5]), dt)
    b = look_ahead(other, wp.vec3d(total[6], total[7], total[8]), wp.vec3d(total[9], total[10], total[11]), dt)
    J, T = hinge_impulses(inverse[j], a, b, wp.float64(1.0) / dt)
    # fmt: off
    if where[1] == 0:
        pull(
            where[2], where[3], lane, place[j], one.mean, J, wp.cross(P - one.mean.centre, J) + T,
            clusters, X, dt, u_out, v_out, speed_square_out,
        )
    else:
        pull(
            where[2], where[3], lane, place[j], other.mean, -J, -(wp.cross(P - other.mean.centre, J) + T),
            clusters, X, dt, u_out, v_out, speed_square_out,
        )
    # fmt: on
    if part == first[0] and lane == 0:
        if latest_out.shape[0] > 0:
            latest_out[j] = J
        orientation_out[j, 0] = quickly_turned(orientation_out[j, 0], dt * spin_after(one.mean, a.spin, J, T))
        orientation_out[j, 1] = quickly_turned(orientation_out[j, 1], dt * spin_after(other.mean, b.spin, -J, -T))
        place_out[j] = place_after(place[j], P, one, other.mean, a, J, T, dt)
        i = clusters.begin[j][0]
        impulse_out[i] = impulse_out[i] + J
