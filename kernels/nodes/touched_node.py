"""Owns the launch in which a GPU moves the fastest nodes of `rated_node`: master, bound and free ones side by side.

Nodes of master faces gather the reactions on them themselves, so that they wait for one launch in place of two.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.contact import LANES
from warp_mca.kernels.contact.search import STALE, moved_too_far
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.hardware.early_launch import begins_early, wait_for_previous
from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import shared_functions
from warp_mca.kernels.nodes.constraint import Bonds, bound_function
from warp_mca.kernels.nodes.node import BOUND, KEEPERS, LEVEL_BIT, TOUCHABLE, gather_function, hold, take_contact
from warp_mca.kernels.records.extremes import keep_normal_force, keep_speed
from warp_mca.kernels.resident.master_role import Faces, faces_near, reaction

wp.set_module_options({"enable_backward": False})

_, exchange = shared_functions("float64")

BLOCK_DIM = 128
RESIDENT = 5  # blocks of threads that a multiprocessor holds, by registers: more would spill
_NO_LANE = 1 << 20  # beyond all faces of a node


@cache
def motion_kernel(precision: str, fixed: bool, each: bool, partial: bool, skips: bool) -> Any:
    """Kernel: LANES threads for each node of master faces, then those of bound nodes, of other nodes, and KEEPERS.

    Arguments are those of `rated_node.integrate_kernel`, whose nodes have level 0 here, `constraint.bound_kernel` and
    `contact.react_kernel`; masters and bounds are the threads of these, whole blocks. No master is bound, and item
    lists none. fixed, each: as `node.integrate_kernel` has them; partial, skips: as `constraint.bound_kernel`.
    """
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)
    vec3 = scalars(precision).vec3
    gather = gather_function(precision, True)
    advance_bound_node = bound_function(precision, True, each, partial, skips, True)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, launch_bounds=(BLOCK_DIM, RESIDENT))
    def move_touched(
        masters: int,
        bounds: int,
        item: wp.array(dtype=wp.int32),
        mass: wp.array(dtype=wp.float64),
        inverse_mass: wp.array(dtype=wp.float64),
        first_slots: wp.array(dtype=wp.vec2i),
        more_slots: wp.array(dtype=wp.vec4i),
        role: wp.array(dtype=wp.uint8),
        force: wp.array(dtype=vec3),
        scene: Index,
        gravity: Vector,
        bonds: Bonds,
        faces: Faces,
        spring: Spring,
        dt: wp.float64,
        contact_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        v_before_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
        normal_force_out: wp.array2d(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
        impulse_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
        work_after_out: wp.array(dtype=wp.vec3d),
        clock_out: wp.array(dtype=wp.int32),
    ):
        thread = wp.tid()
        m = thread // wp.static(LANES)
        last = faces.master.shape[0] - 1
        k = thread - masters - bounds
        i = faces.master[wp.min(m, last)]
        lane = thread % wp.static(LANES)
        if thread >= masters:
            i = item[wp.clamp(k, 0, item.shape[0] - 1)] & wp.static((1 << LEVEL_BIT) - 1)
            lane = wp.static(_NO_LANE)
        near = faces_near(wp.min(m, last), lane, i, faces)
        pair = first_slots[i]
        inverse = inverse_mass[i]
        wait_for_previous()
        share = reaction(i, near, faces, spring)
        for step in range(wp.static(LANES.bit_length() - 1)):
            for c in range(3):
                share[c] += exchange(share[c], 1 << step)
        if thread >= masters and k < 0:
            if thread - masters < bonds.first.shape[0] + bonds.node.shape[0]:
                advance_bound_node(
                    thread - masters, mass, inverse_mass, first_slots, more_slots, role, force, scene, gravity, bonds,
                    dt, contact_force_out, u_out, v_out, v_before_out, speed_square_out,
                    impulse_out, work_out, work_after_out, clock_out,
                )  # fmt: skip
            return
        beyond = k - item.shape[0]
        if beyond >= 0:
            if beyond < wp.static(KEEPERS):  # no node waits for the sums
                keep_normal_force(beyond, wp.static(KEEPERS), normal_force_out)
            return
        if thread < masters and (lane > 0 or m > last):
            return
        own = int(role[i])
        if own & wp.static(BOUND) != 0:
            return
        u = u_out[i]
        v = v_out[i]
        total = gather(pair, more_slots, force)
        if own & wp.static(TOUCHABLE) != 0:
            total += take_contact(i, contact_force_out)
        a = inverse * (total + share) + of(gravity, of(scene, i))
        if wp.static(fixed):
            a = hold(own, a)
        v += dt * a
        v_out[i] = v
        u_out[i] = u + dt * v
        keep_speed(i, v, speed_square_out)
        if thread < masters and moved_too_far(u, faces.u_search[i], faces.margin):
            flag_out[0, wp.static(STALE)] = 1

    return begins_early(move_touched)
