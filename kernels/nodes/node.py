"""Owns how free nodes are advanced, which nothing ties, drives or absorbs: all of them, or those of some levels.

Levels are those of asynchronous variational integrators, see `warp_mca.model.rates`. A node of level k takes the step
2^k dt; an element of level l that acts on it, l >= k, gives the impulse 2^l dt f, which is 2^(l - k) times the force in
a step of the node.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.block import from_start
from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, lets_begin, wait_for_previous
from warp_mca.kernels.hardware.per_scene import kind
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.floating import Frames
from warp_mca.kernels.nodes.gather import (
    BOUND,
    Kind,
    NodeData,
    NodeState,
    acceleration_function,
    move,
    split_level,
    total_force_function,
)
from warp_mca.kernels.records.extremes import keep_normal_force

KEEPERS = 32  # threads that keep the greatest normal force of each scene


@cache
def integrate_kernel(
    own: Kind, fixed: bool = False, bound: bool = False, early: bool = False, beside: bool = False
) -> Any:
    """Kernel: a step of the free nodes from `first` to `end`, see `gather` for its equation.

    Where nodes may have nodal forces, KEEPERS threads beyond `end` run `extremes.keep_normal_force`. `fixed`: some axes
    are at rest. `bound`: some nodes are left to other kernels. `early`: blocks of the next kernel may start while the
    last blocks of this one finish. `beside`: this kernel starts only when the one before it has ended, because it
    belongs to a chain of launches that takes long.

    If `own.rated`, first and end are entries of `item`, the node of each + (its level << LEVEL_BIT), shape
    (active_count,), int32, and kick and drift are those of level 0. Slots then come with the level of the element less
    that of the node.
    """
    vec3, Vector, Index = scalars(own.precision).vec3, kind(wp.vec3d, own.each), kind(wp.int32, own.each)
    total_force, acceleration = total_force_function(own), acceleration_function(own.each, fixed)
    name = "integrate_beside" if beside else "integrate_rated" if own.rated else None

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, name=name)
    def integrate(
        first: int,
        end: int,
        item: wp.array(dtype=wp.int32),
        inverse_mass: wp.array(dtype=wp.float64),
        first_slots: wp.array(dtype=wp.vec2i),
        more_slots: wp.array(dtype=wp.vec4i),
        role: wp.array(dtype=wp.uint8),
        frames: Frames,
        force: wp.array(dtype=vec3),
        scene: Index,
        gravity: Vector,
        kick: wp.float64,
        drift: wp.float64,
        nodal_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        v_before_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
        normal_force_out: wp.array2d(dtype=wp.int64),
    ):
        if wp.static(early):
            let_next_begin()
        # structs that are arguments would be read by address, which takes this short kernel 0.7 us longer on an H100
        nodes = NodeData()
        nodes.inverse_mass = inverse_mass
        nodes.first_slots = first_slots
        nodes.more_slots = more_slots
        nodes.role = role
        nodes.frames = frames
        state_out = NodeState()
        state_out.nodal_force = nodal_force_out
        state_out.u = u_out
        state_out.v = v_out
        state_out.v_before = v_before_out
        state_out.speed_square = speed_square_out
        i = from_start(first + wp.tid())
        beyond = i - end
        if wp.static(own.pushed):
            i = from_start(wp.min(i, end - 1))
        span = drift
        push = kick
        if wp.static(own.rated):
            i, scale = split_level(item[i])
            span *= scale
            push *= scale
        pair = nodes.first_slots[i]
        inverse = nodes.inverse_mass[i]
        wait_for_previous()
        if wp.static(own.pushed):
            if beyond >= 0:  # no node waits for the sums
                keep_normal_force(beyond, wp.static(KEEPERS), normal_force_out)
                return
        if wp.static(bound):
            if int(nodes.role[i]) & wp.static(BOUND) != 0:
                return
        total = total_force(i, pair, nodes, force, state_out.nodal_force)
        v = state_out.v[i] + push * acceleration(i, total, inverse, nodes, scene, gravity)
        move(i, state_out.u[i] + span * v, v, state_out)

    return lets_begin(integrate) if beside else begins_early(integrate)
