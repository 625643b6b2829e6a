"""Owns the nodal stage where elements take steps of their own: a substep advances the nodes of some levels only.

Asynchronous variational integrators, see `warp_mca.model.rates`. A node of level k takes the step 2^k dt; an element of
level l that acts on it, l >= k, gives the impulse 2^l dt f, that is 2^(l - k) times the force in a step of the node.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.node import (
    BOUND,
    KEEPERS,
    LEVEL_BIT,
    TOUCHABLE,
    gather_function,
    hold,
    take_contact,
)
from warp_mca.kernels.records.extremes import keep_normal_force, keep_speed

wp.set_module_options({"enable_backward": False})


@cache
def integrate_kernel(precision: str, contact: bool, fixed: bool, bound: bool, each: bool, early: bool) -> Any:
    """Kernel: as `node.integrate_kernel`, of listed nodes whose kick and drift are 2^level times those given.

    item: node + (level << LEVEL_BIT) of each, shape (active_count,), int32. first_slots, more_slots: slots of the
    elements that act on them in this substep, with the difference of their level and the node's from LEVEL_BIT on.
    """
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)
    vec3 = scalars(precision).vec3
    gather = gather_function(precision, True)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def integrate_rated(
        item: wp.array(dtype=wp.int32),
        inverse_mass: wp.array(dtype=wp.float64),
        first_slots: wp.array(dtype=wp.vec2i),
        more_slots: wp.array(dtype=wp.vec4i),
        role: wp.array(dtype=wp.uint8),
        force: wp.array(dtype=vec3),
        scene: Index,
        gravity: Vector,
        kick: wp.float64,
        drift: wp.float64,
        contact_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        v_before_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
        normal_force_out: wp.array2d(dtype=wp.int64),
    ):
        if wp.static(early):
            let_next_begin()
        k = wp.tid()
        beyond = k - item.shape[0]
        if wp.static(contact):
            k = wp.min(k, item.shape[0] - 1)
        i = item[k] & wp.static((1 << LEVEL_BIT) - 1)
        scale = wp.float64(1 << (item[k] >> wp.static(LEVEL_BIT)))
        pair = first_slots[i]
        inverse = inverse_mass[i]
        wait_for_previous()
        if wp.static(contact):
            if beyond >= 0:  # no node waits for the sums
                keep_normal_force(beyond, wp.static(KEEPERS), normal_force_out)
                return
        if wp.static(bound):
            if int(role[i]) & wp.static(BOUND) != 0:
                return
        total = gather(pair, more_slots, force)
        if wp.static(contact):
            if int(role[i]) & wp.static(TOUCHABLE) != 0:
                total += take_contact(i, contact_force_out)
        a = inverse * total + of(gravity, of(scene, i))
        if wp.static(fixed):
            a = hold(int(role[i]), a)
        v = v_out[i] + (scale * kick) * a
        if v_before_out.shape[0] > 0:
            v_before_out[i] = v_out[i]
        v_out[i] = v
        u_out[i] = u_out[i] + (scale * drift) * v
        keep_speed(i, v, speed_square_out)

    return begins_early(integrate_rated)
