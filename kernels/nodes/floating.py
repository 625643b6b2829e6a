"""Owns floating frames: each follows the mean rotation of a body, and elements compute in it.

Floating frame of reference, Shabana, Multibody System Dynamics 1 (1997) 189. Seen in a frame that has turned by R, a
node is displaced by u_R = R^T (X + u) - X; forces f_R found there are R f_R. Constitutive laws are objective, so that
any R gives the same forces but for rounding: float32 rounds the turn of each element with respect to its frame, in
place of that since the start.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, wait_for_previous


@wp.struct
class Frames:
    """Floating frames; empty where elements compute in the world frame.

    Attributes:
        of_node: frame of each node, shape (node_count,), int32.
        rotation: of each frame since the start of the phase, a unit quaternion [-], shape (frame_count,), quatd.
    """

    of_node: wp.array(dtype=wp.int32)
    rotation: wp.array(dtype=wp.quatd)


@wp.kernel(enable_backward=False)
def follow_bodies(
    X: wp.array(dtype=wp.vec3d),
    marker: wp.array2d(dtype=wp.int32),
    u: wp.array(dtype=wp.vec3d),
    rotation_out: wp.array(dtype=wp.quatd),
):
    """Turn each frame by one Gauss-Newton step towards the least-squares fit of its markers.

    With a = X less its mean and y = R^T x, where x is the place less its mean, d in sum |a + d x a - y|^2 follows from
    sum (|a|^2 I - a a^T) d = sum a x y; R turns by d.
    """
    f = wp.tid()
    q = rotation_out[f]
    X_mean = wp.vec3d()
    x_mean = wp.vec3d()
    for k in range(marker.shape[1]):
        i = marker[f, k]
        X_mean += X[i] / wp.float64(marker.shape[1])
        x_mean += (X[i] + u[i]) / wp.float64(marker.shape[1])
    inertia = wp.mat33d()
    moment = wp.vec3d()
    for k in range(marker.shape[1]):
        i = marker[f, k]
        a = X[i] - X_mean
        inertia += wp.dot(a, a) * wp.identity(n=3, dtype=wp.float64) - wp.outer(a, a)
        moment += wp.cross(a, wp.quat_rotate_inv(q, X[i] + u[i] - x_mean))
    half = wp.float64(0.5) * (wp.inverse(inertia) * moment)
    rotation_out[f] = wp.normalize(q * wp.quatd(half[0], half[1], half[2], wp.float64(1.0)))


@wp.func
def seen(place: wp.vec3d, u: wp.vec3d, q: wp.quatd):
    """Displacement of a node seen in a frame that has turned by q [m]."""
    return wp.quat_rotate_inv(q, place + u) - place


@wp.kernel(enable_backward=False, module="unique", grid_stride=False)
def see_nodes(
    X: wp.array(dtype=wp.vec3d),
    frames: Frames,
    u: wp.array(dtype=wp.vec3d),
    u_out: wp.array(dtype=wp.vec3d),
):
    """Displacement u_R [m] of each node in its frame."""
    i = wp.tid()
    place = X[i]
    f = frames.of_node[i]
    wait_for_previous()
    let_next_begin()
    u_out[i] = seen(place, u[i], frames.rotation[f])


begins_early(see_nodes)


@cache
def turn_function(turned: bool) -> Any:
    """The function that turns a force on a node from its frame to the world's; without `turned`, they are one."""

    @wp.func
    def to_world(i: int, f: wp.vec3d, frames: Frames):
        if wp.static(turned):
            return wp.quat_rotate(frames.rotation[frames.of_node[i]], f)
        return f

    return to_world
