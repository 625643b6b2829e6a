"""Owns how nodes tied to faces are advanced: masters take the forces on their slaves, then slaves follow them."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.per_scene import kind
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import shared_functions
from warp_mca.kernels.nodes.gather import (
    Kind,
    NodeData,
    NodeState,
    acceleration_function,
    element_force_function,
    move,
    nodal_force_function,
)

LANES = 8  # GPU threads per master node; it has about 25 slaves where its cells are three times as wide


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
def masters_kernel(own: Kind, lanes: int = 1) -> Any:
    """Kernel: a step of the nodes that carry slaves; arguments as in `node.integrate_kernel`.

    M_k a_k = f_k + sum_s N_sk f_s, where M_k holds the slaves' share of mass. `lanes` threads share the slaves of a
    master, and sum them in a fixed order. Nodal forces on slaves are read here and cleared by `follow`.
    """
    vec3, Vector, Index = scalars(own.precision).vec3, kind(wp.vec3d, own.each), kind(wp.int32, own.each)
    element_force, with_nodal_force = element_force_function(own), nodal_force_function(own.pushed)
    acceleration = acceleration_function(own.each)
    _, exchange = shared_functions("float64")

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def advance_masters(
        nodes: NodeData,
        force: wp.array(dtype=vec3),
        scene: Index,
        gravity: Vector,
        tied: Tied,
        dt: wp.float64,
        state_out: NodeState,
    ):
        lane = wp.tid() % wp.static(lanes)
        k = wp.tid() // wp.static(lanes)
        i = tied.master[k]
        total = wp.vec3d()
        for e in range(tied.first[k] + lane, tied.first[k + 1], wp.static(lanes)):
            s = tied.carried[e]
            f = element_force(s, nodes.first_slots[s], nodes, force)
            if wp.static(own.pushed):
                f += state_out.nodal_force[s]
            total += tied.share[e] * f
        if wp.static(lanes > 1):
            for step in range(wp.static(lanes.bit_length() - 1)):
                for c in range(3):
                    total[c] += exchange(total[c], 1 << step)
        if lane > 0:
            return
        total += element_force(i, nodes.first_slots[i], nodes, force)
        total = with_nodal_force(i, total, nodes, state_out.nodal_force)
        v = state_out.v[i] + dt * acceleration(i, total, nodes.inverse_mass[i], nodes, scene, gravity)
        move(i, state_out.u[i] + dt * v, v, state_out)

    return advance_masters


@cache
def follow_kernel(pushed: bool) -> Any:
    """Kernel: slaves take u = sum_k N_k u_k and v = sum_k N_k v_k of their masters, which have moved."""

    @wp.func
    def interpolate(w: wp.vec4d, c: wp.vec4i, value: wp.array(dtype=wp.vec3d)):
        return w[0] * value[c[0]] + w[1] * value[c[1]] + w[2] * value[c[2]] + w[3] * value[c[3]]

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def follow(tied: Tied, state_out: NodeState):
        k = wp.tid()
        i = tied.slave[k]
        if wp.static(pushed):
            state_out.nodal_force[i] = wp.vec3d()
        v = interpolate(tied.weight[k], tied.corner[k], state_out.v)
        move(i, interpolate(tied.weight[k], tied.corner[k], state_out.u), v, state_out)

    return follow
