"""Owns the launch in which a GPU computes patches of `hex8` and the slave nodes of a contact, side by side.

Where few elements are computed, a step waits for launches and for what parts and joins branches of a graph.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.contact import LANES
from warp_mca.kernels.contact.nearest import Master
from warp_mca.kernels.contact.search import STALE, moved_too_far
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.elements.hex8_patch import patches_function
from warp_mca.kernels.elements.patch import POINT, RESIDENT, Patches
from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.resident.contact_role import Slaves, last_pressure, nearest_of_lanes, touch_function
from warp_mca.model.patches import PATCH

wp.set_module_options({"enable_backward": False})


@cache
def slave_function(friction: bool, stress_free: bool, law: str) -> Any:
    """The function that gives a slave node its contact force, by LANES threads in a row."""
    touch_nearest = touch_function(friction, stress_free, law)

    @wp.func
    def touch_slave(
        thread: int,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        slaves: Slaves,
        master: Master,
        dt: wp.float64,
        spring: Spring,
        contact_force_out: wp.array(dtype=wp.vec3d),
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        item = thread // wp.static(LANES)
        last = slaves.node.shape[0] - 1
        s = wp.min(item, last)
        q = thread % wp.static(LANES)
        i = slaves.node[s]
        along = last_pressure(s, wp.static(friction), spring)
        held = spring.held[s]
        near, holds = nearest_of_lanes(X, u, master, s, X[i] + u[i], along, q)
        if item <= last and holds:
            touch_nearest(
                s, i, v, near, along, held, slaves, master, dt, spring,
                contact_force_out, normal_force_out, flag_out,
            )  # fmt: skip
        if q == 0 and moved_too_far(u[i], slaves.u_search[i], slaves.margin):
            flag_out[0, wp.static(STALE)] = 1

    return touch_slave


@cache
def force_kernel(precision: str, law_name: str, friction: bool, stress_free: bool, contact_law: str) -> Any:
    """Kernel: `stride` blocks of threads as `hex8_patch.force_kernel`, those after them slave nodes of one pass."""
    t = scalars(precision)
    R, vec3, point = t.real, t.vec3, POINT[precision]
    compute_patches = patches_function(precision, law_name)
    touch_slave = slave_function(friction, stress_free, contact_law)

    @wp.kernel(
        enable_backward=False,
        module="unique",
        grid_stride=False,
        launch_bounds=(PATCH, RESIDENT[precision]),
        module_options={"fast_math": True},
    )
    def hex8_touch_force(
        X: wp.array(dtype=wp.vec3d),
        points: wp.array(dtype=point),
        patches: Patches,
        law: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        slot: int,
        stride: int,
        v: wp.array(dtype=wp.vec3d),
        slaves: Slaves,
        master: Master,
        dt: wp.float64,
        spring: Spring,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        flowing_out: wp.array(dtype=wp.int32),
        force_out: wp.array(dtype=vec3),
        contact_force_out: wp.array(dtype=wp.vec3d),
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        lane = wp.tid() & wp.static(PATCH - 1)
        block = wp.tid() // wp.static(PATCH)
        if block < stride:
            compute_patches(
                lane, block, X, points, patches, law, u, slot, stride,
                yielded_out, history_out, extreme_out, flowing_out, force_out,
            )  # fmt: skip
        else:
            wait_for_previous()
            let_next_begin()
            touch_slave(
                wp.tid() - stride * wp.static(PATCH), X, u, v, slaves, master, dt, spring,
                contact_force_out, normal_force_out, flag_out,
            )  # fmt: skip

    return begins_early(hex8_touch_force)
