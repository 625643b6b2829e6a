"""Owns how nodes of absorbing boundaries are advanced: springs, and dashpots implicit in the node's own velocity."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.per_scene import kind
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.gather import (
    Kind,
    NodeData,
    NodeState,
    acceleration_function,
    move,
    split_level,
    total_force_function,
)
from warp_mca.kernels.records.half_steps import add_half_steps


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
def absorbing_kernel(own: Kind, springs: bool) -> Any:
    """Kernel: a step of the nodes that dashpots act on; arguments as in `node.integrate_kernel`.

    impulse_out [N s] is the impulse of each node on the surroundings up to t(n), absorbed_out [J] the energy given to
    them in the frame of the body. Since the force at t(n) acts for half a step on either side of t(n), the arrays with
    `after` hold both half a step later. With `springs`, stretch_out [m] is u(n) less the travel of the body. If
    `own.rated`, nodes are those of `item`, place among the dashpots + (level << LEVEL_BIT), and dt is the
    step of level 0.
    """
    vec3, Vector, Index = scalars(own.precision).vec3, kind(wp.vec3d, own.each), kind(wp.int32, own.each)
    total_force, acceleration = total_force_function(own), acceleration_function(own.each)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def advance_absorbing(
        item: wp.array(dtype=wp.int32),
        dashpots: Dashpots,
        nodes: NodeData,
        force: wp.array(dtype=vec3),
        scene: Index,
        gravity: Vector,
        dt: wp.float64,
        state_out: NodeState,
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
        if wp.static(own.rated):
            k, scale = split_level(item[k])
            step *= scale
        i = dashpots.node[k]
        v_body = dashpots.velocity[k]
        total = total_force(i, nodes.first_slots[i], nodes, force, state_out.nodal_force)
        spring = wp.vec3d()
        if wp.static(springs):
            spring = dashpots.stiffness[k] * stretch_out[k]
            total -= spring
        before = state_out.v[i]
        free = before + step * acceleration(i, total, nodes.inverse_mass[i], nodes, scene, gravity)
        v, w = dampen(before, free, v_body, dashpots.share[k])
        half = wp.float64(0.5) * step * (dashpots.damping[k] * w + spring)
        add_half_steps(k, half, half, impulse_out, impulse_after_out)
        add_half_steps(k, wp.dot(half, before - v_body), wp.dot(half, v - v_body), absorbed_out, absorbed_after_out)
        if wp.static(springs):
            stretch_out[k] = stretch_out[k] + step * (v - v_body)
        move(i, state_out.u[i] + step * v, v, state_out)

    return begins_early(advance_absorbing)
