"""Owns pins between a rigid body and a cluster: nodes of a flexible body that share a mean motion.

`cluster` defines the mean motion and its response to impulses. Here the cluster takes part in the rows of `rigid_rows`:
three rows hold the pin's points of both sides together, two the directions of its axis.
"""

import warp as wp

from warp_mca.kernels.nodes.cluster import Clusters, Mean, cluster_sums, mean_motion, pull, spin_after
from warp_mca.kernels.nodes.coupling import turned
from warp_mca.kernels.nodes.gather import NodeState
from warp_mca.kernels.nodes.rigid_motion import Poses, RigidStep


@wp.func
def find_cluster(
    p: int,
    lane: int,
    place: wp.vec3d,
    clusters: Clusters,
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    dt: wp.float64,
    poses: Poses,
    state: NodeState,
    step_out: RigidStep,
):
    """Mean motion of a pin's cluster after the free step, and its point P at t(n), from the place at the start."""
    begin = clusters.begin[p]
    total = cluster_sums(begin[0], begin[1], lane, place, clusters, X, mass, state.u, state.v, dt)
    if lane == 0:
        P = wp.vec3d(total[1], total[2], total[3]) / total[0] + wp.quat_rotate(poses.orientation[p], clusters.arm[p, 0])
        step_out.mean[p] = mean_motion(total, P)
        step_out.point[p] = P
        step_out.impulse[p, 0] = wp.vec3d()
        step_out.impulse[p, 1] = wp.vec3d()


@wp.func
def move_pin(p: int, clusters: Clusters, dt: wp.float64, poses: Poses, step_out: RigidStep):
    """Point of a pin on the cluster at t(n+1), relative to its place at the start [m], and its axis there."""
    m = step_out.mean[p]
    J = step_out.impulse[p, 0]
    T = step_out.impulse[p, 1]
    arm = step_out.point[p] - m.centre
    w = spin_after(m, m.spin, J, T)
    v = m.velocity + wp.cross(m.spin, arm) + m.response.point * J + m.response.mixed * T - wp.cross(w, arm)
    ahead = turned(poses.orientation[p], dt * w)
    step_out.place[p] = m.centre + dt * v + wp.quat_rotate(ahead, clusters.arm[p, 0])
    step_out.axis[p] = wp.quat_rotate(ahead, clusters.axis[p])


@wp.func
def pin_lightness(mean: Mean, n: wp.vec3d, t: wp.vec3d, m: wp.vec3d, s: wp.vec3d) -> wp.float64:
    """Speed of a cluster along n at its pin and about t, due to a unit impulse along m and one about s."""
    point = mean.response.point * m + mean.response.mixed * s
    turn = wp.transpose(mean.response.mixed) * m + mean.response.turn * s
    return wp.dot(n, point) + wp.dot(t, turn)


@wp.func
def pull_cluster(
    p: int,
    lane: int,
    place: wp.vec3d,
    clusters: Clusters,
    X: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    step: RigidStep,
    state_out: NodeState,
):
    """Distribute the impulses of a pin to the nodes of its cluster."""
    begin = clusters.begin[p]
    m = step.mean[p]
    J = step.impulse[p, 0]
    T = wp.cross(step.point[p] - m.centre, J) + step.impulse[p, 1]
    pull(begin[0], begin[1], lane, place, m, J, T, clusters, X, dt, state_out.u, state_out.v, state_out.speed_square)
