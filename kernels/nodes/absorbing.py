"""Owns how nodes of absorbing boundaries are advanced: springs, and dashpots implicit in the node's own velocity."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.floating import Frames
from warp_mca.kernels.nodes.node import LEVEL_BIT, TOUCHABLE, hold, nodal_force_function, take_contact
from warp_mca.kernels.records.extremes import keep_speed

wp.set_module_options({"enable_backward": False})


@wp.struct
class Dashpots:
    """Dashpots and springs of absorbing boundaries, lumped to nodes.

    Attributes:
        node: shape (count,), int32.
        damping: matrix C of each node [N s/m], shape (count,), mat33d.
        stiffness: matrix S of each node [N/m], shape (count,), mat33d; empty where there are no springs.
        share: (I + dt C / (2 m))^-1, what the dashpots leave of a node's velocity [-], shape (count,), mat33d.
        velocity: relative to which they act [m/s], shape (count,), vec3d.
    """

    node: wp.array(dtype=wp.int32)
    damping: wp.array(dtype=wp.mat33d)
    stiffness: wp.array(dtype=wp.mat33d)
    share: wp.array(dtype=wp.mat33d)
    velocity: wp.array(dtype=wp.vec3d)


@wp.func
def dampen(before: wp.vec3d, free: wp.vec3d, own: wp.vec3d, share: wp.mat33d):
    """Velocity v+ at the end of a step with dashpots, and the mean velocity w relative to the body's `own` v0.

    m (v+ - v-) / dt = f - C w with w = (v- + v+) / 2 - v0, where `before` is v- and `free` is v* = v- + dt f / m. So
    (I + dt C / (2 m)) w = (v- + v*) / 2 - v0, and v+ = v* + 2 (w - ((v- + v*) / 2 - v0)).
    """
    undamped = wp.float64(0.5) * (before + free) - own
    w = share * undamped
    return free + wp.float64(2.0) * (w - undamped), w


@cache
def absorbing_kernel(
    precision: str, contact: bool, springs: bool, each: bool = False, rated: bool = False, turned: bool = False
) -> Any:
    """Kernel: advance the nodes that dashpots act on; arguments as in `node.integrate_kernel`.

    impulse_out [N s] is what each node has given to what lies beyond the boundary up to t(n), absorbed_out [J] the
    energy that it gave in the frame of the body. As the force at t(n) acts for half a step on either side of
    it, the arrays with `after` hold the same half a step later. With `springs`, stretch_out [m] is u(n) less the way of
    the body. `rated`, `turned` as in `nodal_force_function`; `rated` nodes are those of `item`, place among the
    dashpots + (level << LEVEL_BIT), whose step is 2^level times `dt`.
    """
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)
    vec3 = scalars(precision).vec3
    nodal_force = nodal_force_function(precision, rated, turned)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def advance_absorbing(
        item: wp.array(dtype=wp.int32),
        dashpots: Dashpots,
        inverse_mass: wp.array(dtype=wp.float64),
        first_slots: wp.array(dtype=wp.vec2i),
        more_slots: wp.array(dtype=wp.vec4i),
        role: wp.array(dtype=wp.uint8),
        force: wp.array(dtype=vec3),
        frames: Frames,
        scene: Index,
        gravity: Vector,
        dt: wp.float64,
        contact_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        v_before_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
        impulse_out: wp.array(dtype=wp.vec3d),
        impulse_after_out: wp.array(dtype=wp.vec3d),
        absorbed_out: wp.array(dtype=wp.float64),
        absorbed_after_out: wp.array(dtype=wp.float64),
        stretch_out: wp.array(dtype=wp.vec3d),
    ):
        wait_for_previous()
        let_next_begin()
        k = wp.tid()
        step = dt
        if wp.static(rated):
            step *= wp.float64(1 << (item[k] >> wp.static(LEVEL_BIT)))
            k = item[k] & wp.static((1 << LEVEL_BIT) - 1)
        i = dashpots.node[k]
        own = dashpots.velocity[k]
        total = nodal_force(i, first_slots[i], more_slots, force, frames)
        if wp.static(contact):
            if int(role[i]) & wp.static(TOUCHABLE) != 0:
                total += take_contact(i, contact_force_out)
        spring = wp.vec3d()
        if wp.static(springs):
            spring = dashpots.stiffness[k] * stretch_out[k]
            total -= spring
        a = hold(int(role[i]), inverse_mass[i] * total + of(gravity, of(scene, i)))
        before = v_out[i]
        v, w = dampen(before, before + step * a, own, dashpots.share[k])
        half = wp.float64(0.5) * step * (dashpots.damping[k] * w + spring)
        impulse = impulse_after_out[k] + half
        absorbed = absorbed_after_out[k] + wp.dot(half, before - own)
        impulse_out[k] = impulse
        impulse_after_out[k] = impulse + half
        absorbed_out[k] = absorbed
        absorbed_after_out[k] = absorbed + wp.dot(half, v - own)
        if wp.static(springs):
            stretch_out[k] = stretch_out[k] + step * (v - own)
        if v_before_out.shape[0] > 0:
            v_before_out[i] = before
        v_out[i] = v
        u_out[i] = u_out[i] + step * v
        keep_speed(i, v, speed_square_out)

    return begins_early(advance_absorbing)
