"""Owns the springs between edges that cross: their forces, and the share of each end of an edge."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.edge_meet import NOBODY, Met
from warp_mca.kernels.contact.edge_pairs import REACH, SLOTS, SkinEdges, pair_factor
from warp_mca.kernels.contact.laws import Laws
from warp_mca.kernels.contact.search import TOO_DEEP
from warp_mca.kernels.contact.spring import Spring, release_function, rest_function, spring_function
from warp_mca.kernels.contact.switching import GONE, face_left, forget
from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.records.extremes import add_normal_force


@wp.func
def clear(s: int, spring: Spring):
    """Leave nothing in a spring of which another has all that it held."""
    zero = wp.float64(0.0)
    spring.energy[s] = zero
    spring.normal_energy[s] = zero
    spring.force[s] = wp.vec3d()
    spring.tangential[s] = wp.vec3d()
    spring.face[s] = GONE
    forget(s, spring)


@wp.func
def take_over(s: int, b: int, met: Met, spring: Spring) -> wp.float64:
    """Let spring s press edge b with all that another one held, also what that owed; its stiffness [N/m]."""
    k, along, energy = met.stiffness[s], met.tangential[s], met.energy[s]
    spring.force[s] = met.force[s]
    spring.tangential[s] = along
    spring.energy[s] = energy
    spring.normal_energy[s] = energy - wp.float64(0.5) * wp.dot(along, along) / k
    spring.face[s] = b
    forget(s, spring)  # it is part of this energy
    return k


@wp.func
def motion_of_old(s: int, v: wp.array(dtype=wp.vec3d), slave: SkinEdges, master: SkinEdges, spring: Spring):
    """Relative velocity of the points that spring s has pressed [m/s]."""
    a = s / wp.static(SLOTS)
    g = face_left(spring.face[s])
    w = spring.weight[s]
    own = w[0] * v[slave.node[a, 0]] + w[1] * v[slave.node[a, 1]]
    return own - w[2] * v[master.node[g, 0]] - w[3] * v[master.node[g, 1]]


@cache
def part_function(friction: bool, laws: Laws) -> Any:
    """The function that opens a spring whose edges no longer touch, at once or in steps that return what it owes."""
    let_open = release_function(friction, laws)

    @wp.func
    def part(
        s: int,
        v: wp.array(dtype=wp.vec3d),
        slave: SkinEdges,
        master: SkinEdges,
        count: wp.array(dtype=wp.int32),
        candidate: wp.array2d(dtype=wp.int32),
        dt: wp.float64,
        may_stay: bool,
        spring: Spring,
    ):
        normal, stays = wp.vec3d(), bool(False)
        if wp.static(laws.returns):
            a, g = s / wp.static(SLOTS), spring.face[s]
            pressed = spring.force[s]
            if wp.static(friction):
                pressed -= spring.tangential[s]
            normal = wp.normalize(pressed)
            if g < GONE and spring.owed[s][1] < wp.float64(0.0):
                normal = -normal  # it pulled
            for c in range(count[a]):  # both edges take their shares only then
                stays = stays or candidate[a, c] == face_left(g)
            stays = stays and may_stay and wp.length_sq(pressed) > wp.float64(0.0)
        let_open(s, dt * motion_of_old(s, v, slave, master, spring), normal, spring.stiffness[s], stays, spring)

    return part


@cache
def press_kernel(friction: bool, each: bool, laws: Laws) -> Any:
    """Kernel: force of each spring, from spring `first` on: those that `meet_kernel` found edges for, others open."""
    press, part = spring_function(friction, laws), part_function(friction, laws)
    gap_from_rest = rest_function(laws.pressed)
    of, Real, Index = value_function(each), kind(wp.float64, each), kind(wp.int32, each)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def press_edges(
        first: int,
        v: wp.array(dtype=wp.vec3d),
        slave: SkinEdges,
        master: SkinEdges,
        count: wp.array(dtype=wp.int32),
        candidate: wp.array2d(dtype=wp.int32),
        scene: Index,
        mu: Real,
        per_newton: Real,
        dt: wp.float64,
        met: Met,
        spring: Spring,
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        s = first + wp.tid()
        a = s / wp.static(SLOTS)
        b = met.edge[s]
        k = of(scene, a)
        k_old = wp.float64(0.0)
        factor = wp.float64(1.0)
        if b >= 0:
            before = met.before[s]
            factor = pair_factor(slave, master, a, b)
            k_old = factor * wp.min(slave.stiffness[a], master.stiffness[b])
            if before == s:
                k_old = spring.stiffness[s]
                if met.taken[s] != wp.static(NOBODY):
                    b = int(-1)
            elif before >= 0:
                if met.taken[before] == s:
                    k_old = take_over(s, b, met, spring)
                else:
                    b = int(-1)
        if wp.static(laws.returns):
            if b >= 0 and spring.face[s] < GONE and face_left(spring.face[s]) != b:
                part(s, v, slave, master, count, candidate, dt, bool(False), spring)
        if b >= 0:
            gap = met.gap[s]
            rest = wp.where(met.before[s] == s, spring.rest[s], met.rest[s])
            pressed, rest = gap_from_rest(s, gap, rest, spring)
            spring.rest[s] = rest
            stiffness = wp.min(k_old, factor * master.stiffness[b])
            _, F_n = press(s, pressed, met.normal[s], met.normal[s], met.du[s], k_old, stiffness, of(mu, k), dt, spring)
            add_normal_force(k, F_n, of(per_newton, k), normal_force_out)
            spring.face[s] = b
            spring.stiffness[s] = stiffness
            spring.weight[s] = met.weight[s]
            spring.held[s] = -gap
            if -gap > wp.float64(REACH) * wp.min(slave.size[a], master.size[b]):
                flag_out[k, TOO_DEEP] = 1
        elif spring.face[s] != GONE:
            if met.taken[s] == wp.static(NOBODY):
                part(s, v, slave, master, count, candidate, dt, bool(True), spring)
            else:
                clear(s, spring)
            spring.held[s] = wp.float64(0.0)

    return press_edges


@cache
def share_kernel() -> Any:
    """Kernel: each end of an edge takes its share of the forces on it, in a fixed order; from node `first` on."""

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def share_edges(
        first: int,
        node: wp.array(dtype=wp.int32),
        offset: wp.array(dtype=wp.int32),
        edge: wp.array(dtype=wp.int32),
        slave: SkinEdges,
        master: SkinEdges,
        edge_count: wp.array(dtype=wp.int32),
        edge_slave: wp.array2d(dtype=wp.int32),
        spring: Spring,
        met_out: Met,
        nodal_force_out: wp.array(dtype=wp.vec3d),
    ):
        m = first + wp.tid()
        if m < met_out.taken.shape[0]:
            met_out.taken[m] = wp.static(NOBODY)
        if m < node.shape[0]:
            i = node[m]
            total = wp.vec3d()
            for j in range(offset[m], offset[m + 1]):
                e = edge[j]
                if e >= 0:
                    end = wp.where(slave.node[e, 1] == i, 1, 0)
                    for s in range(wp.static(SLOTS) * e, wp.static(SLOTS) * (e + 1)):
                        if spring.face[s] != GONE:
                            w = spring.weight[s]
                            total += w[end] * spring.force[s]
                else:  # edges of the master are counted down from -1
                    f = -1 - e
                    end = wp.where(master.node[f, 1] == i, 3, 2)
                    for q in range(wp.min(edge_count[f], edge_slave.shape[1])):
                        a = edge_slave[f, q]
                        for s in range(wp.static(SLOTS) * a, wp.static(SLOTS) * (a + 1)):
                            if face_left(spring.face[s]) == f:
                                w = spring.weight[s]
                                total -= w[end] * spring.force[s]
            if wp.length_sq(total) > wp.float64(0.0):
                nodal_force_out[i] = nodal_force_out[i] + total

    return share_edges
