"""Owns how nodes tied to faces are advanced: masters take the forces on their slaves, then slaves follow them."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import shared_functions
from warp_mca.kernels.nodes.floating import Frames
from warp_mca.kernels.nodes.node import hold, nodal_force_function, take_contact
from warp_mca.kernels.records.extremes import keep_speed

wp.set_module_options({"enable_backward": False})

LANES = 8  # threads of a GPU that gather the slaves of a master: 25 of them where the cells are as 3 to 1


@wp.struct
class Tied:
    """Slaves and masters of a model.

    Attributes:
        slave: tied nodes, shape (slave_count,), int32.
        corner: masters of each, shape (slave_count,), vec4i.
        weight: their shape functions N at the slave [-], shape (slave_count,), vec4d.
        master: nodes that carry slaves, shape (master_count,), int32.
        first: first slave of each in `carried`, and the number of all, shape (master_count + 1,), int32.
        carried: slaves of each master one after the other, in the order of their numbers, shape (entry_count,), int32.
        share: N of the master at each [-], shape (entry_count,), float64.
    """

    slave: wp.array(dtype=wp.int32)
    corner: wp.array(dtype=wp.vec4i)
    weight: wp.array(dtype=wp.vec4d)
    master: wp.array(dtype=wp.int32)
    first: wp.array(dtype=wp.int32)
    carried: wp.array(dtype=wp.int32)
    share: wp.array(dtype=wp.float64)


@cache
def masters_kernel(
    precision: str, contact: bool, each: bool = False, rated: bool = False, lanes: int = 1, turned: bool = False
) -> Any:
    """Kernel: central difference of the nodes that carry slaves; arguments as of `node.integrate_kernel`.

    M_k a_k = f_k + sum_s N_sk f_s, where M_k holds the slaves' share of mass. Slaves are summed in a fixed order, by so
    many `lanes` side by side. Contact forces on slaves are read here and reset by `follow`. `rated`,
    `turned` as in `nodal_force_function`.
    """
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)
    vec3 = scalars(precision).vec3
    nodal_force = nodal_force_function(precision, rated, turned)
    _, exchange = shared_functions("float64")

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def advance_masters(
        inverse_mass: wp.array(dtype=wp.float64),
        first_slots: wp.array(dtype=wp.vec2i),
        more_slots: wp.array(dtype=wp.vec4i),
        role: wp.array(dtype=wp.uint8),
        force: wp.array(dtype=vec3),
        frames: Frames,
        scene: Index,
        gravity: Vector,
        tied: Tied,
        dt: wp.float64,
        contact_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        v_before_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
    ):
        lane = wp.tid() % wp.static(lanes)
        k = wp.tid() // wp.static(lanes)
        i = tied.master[k]
        total = wp.vec3d()
        for e in range(tied.first[k] + lane, tied.first[k + 1], wp.static(lanes)):
            s = tied.carried[e]
            f = nodal_force(s, first_slots[s], more_slots, force, frames)
            if wp.static(contact):
                f += contact_force_out[s]
            total += tied.share[e] * f
        if wp.static(lanes > 1):
            for step in range(wp.static(lanes.bit_length() - 1)):
                for c in range(3):
                    total[c] += exchange(total[c], 1 << step)
        if lane > 0:
            return
        total += nodal_force(i, first_slots[i], more_slots, force, frames)
        if wp.static(contact):
            total += take_contact(i, contact_force_out)
        a = hold(int(role[i]), inverse_mass[i] * total + of(gravity, of(scene, i)))
        v = v_out[i] + dt * a
        if v_before_out.shape[0] > 0:
            v_before_out[i] = v_out[i]
        v_out[i] = v
        u_out[i] = u_out[i] + dt * v
        keep_speed(i, v, speed_square_out)

    return advance_masters


@cache
def follow_kernel(contact: bool) -> Any:
    """Kernel: slaves take u = sum_k N_k u_k and v = sum_k N_k v_k of their masters, which have moved."""

    @wp.func
    def interpolate(w: wp.vec4d, c: wp.vec4i, value: wp.array(dtype=wp.vec3d)):
        return w[0] * value[c[0]] + w[1] * value[c[1]] + w[2] * value[c[2]] + w[3] * value[c[3]]

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def follow(
        tied: Tied,
        contact_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        v_before_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
    ):
        k = wp.tid()
        i = tied.slave[k]
        if wp.static(contact):
            contact_force_out[i] = wp.vec3d()
        if v_before_out.shape[0] > 0:
            v_before_out[i] = v_out[i]
        v = interpolate(tied.weight[k], tied.corner[k], v_out)
        v_out[i] = v
        u_out[i] = interpolate(tied.weight[k], tied.corner[k], u_out)
        keep_speed(i, v, speed_square_out)

    return follow
