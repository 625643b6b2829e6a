"""Owns the springs between edges that cross: which edges press, their forces, and the share of each end."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.edge_pairs import (
    REACH,
    SLOTS,
    SkinEdges,
    crossing,
    goes_on,
    lies_clear,
    pair_factor,
    resting_depth,
    share_an_end,
)
from warp_mca.kernels.contact.laws import Laws
from warp_mca.kernels.contact.search import TOO_DEEP
from warp_mca.kernels.contact.spring import Spring, open_function, rest_function, spring_function
from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.records.extremes import add_normal_force

NOBODY = 2**31 - 1  # takes a spring over


@wp.struct
class Met:
    """What each spring presses in this step; arrays have shape (spring_count,).

    Attributes:
        edge: of the master, or -1.
        before: the spring whose crossing goes on here, itself if it did, or -1 for a new crossing.
        taken: the spring that takes this one's crossing over, or NOBODY.
        weight, normal, gap, du: as in `Crossing`.
        rest: depth at which a spring that begins is free of force [m].
        force, tangential, stiffness, energy, owed: of the spring `before` in the last step [N], [N/m], [J].
    """

    edge: wp.array(dtype=wp.int32)
    before: wp.array(dtype=wp.int32)
    taken: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.vec4d)
    normal: wp.array(dtype=wp.vec3d)
    gap: wp.array(dtype=wp.float64)
    du: wp.array(dtype=wp.vec3d)
    rest: wp.array(dtype=wp.float64)
    force: wp.array(dtype=wp.vec3d)
    tangential: wp.array(dtype=wp.vec3d)
    stiffness: wp.array(dtype=wp.float64)
    energy: wp.array(dtype=wp.float64)
    owed: wp.array(dtype=wp.float64)


@wp.struct
class Chains:
    """Edges of the slave that meet each of them at a node, itself first: compressed rows.

    Attributes:
        offset: first entry of each edge, shape (edge_count + 1,), int32.
        edge: those edges, int32.
    """

    offset: wp.array(dtype=wp.int32)
    edge: wp.array(dtype=wp.int32)


@wp.func
def predecessor(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    slave: SkinEdges,
    master: SkinEdges,
    chains: Chains,
    a: int,
    b: int,
    normal: wp.vec3d,
    spring: Spring,
) -> int:
    """The deepest spring whose crossing left its edges over a node, to go on between edges a and b; or -1."""
    best = int(-1)
    depth = wp.float64(0.0)
    for c in range(chains.offset[a], chains.offset[a + 1]):
        other = chains.edge[c]
        for r in range(wp.static(SLOTS) * other, wp.static(SLOTS) * (other + 1)):
            g = spring.face[r]
            if g >= 0 and spring.held[r] > depth:
                if share_an_end(master, wp.max(g, 0), b):
                    pressed = spring.force[r] - spring.tangential[r]
                    if wp.dot(pressed, normal) > wp.float64(0.7) * wp.length(pressed):
                        if not crossing(X, u, v, slave, master, other, g, wp.float64(0.0), True).touches:
                            best = r
                            depth = spring.held[r]
    return best


@cache
def meet_kernel() -> Any:
    """Kernel: find the edges of the master that press each edge of the slave in this step, from edge `first` on.

    It reads springs of other edges, which `press_kernel` changes then.
    """

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def meet_edges(
        first: int,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        slave: SkinEdges,
        master: SkinEdges,
        chains: Chains,
        count: wp.array(dtype=wp.int32),
        candidate: wp.array2d(dtype=wp.int32),
        dt: wp.float64,
        spring: Spring,
        met_out: Met,
    ):
        a = first + wp.tid()
        begin = wp.static(SLOTS) * a
        end = begin + wp.static(SLOTS)
        for s in range(begin, end):
            met_out.edge[s] = -1
        for c in range(count[a]):
            b = candidate[a, c]
            place = int(-1)
            for s in range(begin, end):
                if spring.face[s] == b:
                    place = s
            hit = crossing(X, u, v, slave, master, a, b, dt, place >= 0)
            if hit.touches:
                size = wp.min(slave.size[a], master.size[b])
                before = place
                begins = place >= 0
                rest = wp.float64(0.0)
                if place < 0:
                    before = predecessor(X, u, v, slave, master, chains, a, b, hit.normal, spring)
                    if before >= 0:
                        begins = goes_on(-hit.gap, spring.held[before], hit.approach, size)
                        rest = spring.rest[before]
                    else:
                        rest = resting_depth(-hit.gap, hit.approach, size)
                        begins = rest >= wp.float64(0.0)
                        if begins:
                            begins = lies_clear(X, u, slave, a, master, b, hit.weight[1], size)
                        if begins:
                            begins = lies_clear(X, u, master, b, slave, a, hit.weight[3], size)
                if begins and place < 0:
                    for s in range(end - 1, begin - 1, -1):
                        if spring.face[s] < 0 and met_out.edge[s] < 0:
                            place = s
                if begins and place >= 0:
                    met_out.edge[place] = b
                    met_out.before[place] = before
                    met_out.weight[place] = hit.weight
                    met_out.normal[place] = hit.normal
                    met_out.gap[place] = hit.gap
                    met_out.du[place] = hit.du
                    met_out.rest[place] = rest
                    if before >= 0 and before != place:
                        wp.atomic_min(met_out.taken, before, place)
                        met_out.force[place] = spring.force[before]
                        met_out.tangential[place] = spring.tangential[before]
                        met_out.stiffness[place] = spring.stiffness[before]
                        met_out.energy[place] = spring.energy[before]
                        met_out.owed[place] = spring.owed[before]

    return meet_edges


@cache
def press_kernel(friction: bool, each: bool, laws: Laws) -> Any:
    """Kernel: force of each spring, from spring `first` on: those that `meet_kernel` found edges for, others open."""
    press, open_contact = spring_function(friction, laws), open_function(friction, laws)
    gap_from_rest = rest_function(True)
    of, Real, Index = value_function(each), kind(wp.float64, each), kind(wp.int32, each)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def press_edges(
        first: int,
        v: wp.array(dtype=wp.vec3d),
        slave: SkinEdges,
        master: SkinEdges,
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
            elif before >= 0:
                if met.taken[before] == s:
                    k_old = met.stiffness[s]
                    spring.force[s] = met.force[s]
                    spring.tangential[s] = met.tangential[s]
                    spring.energy[s] = met.energy[s]
                    spring.owed[s] = met.owed[s]
                    spring.face[s] = b
                else:
                    b = int(-1)
        if b >= 0:
            gap = met.gap[s]
            if met.before[s] != s:
                spring.rest[s] = met.rest[s]
            pressed = gap_from_rest(s, gap, spring)
            stiffness = wp.min(k_old, factor * master.stiffness[b])
            _, F_n = press(s, pressed, met.normal[s], met.du[s], k_old, stiffness, of(mu, k), dt, spring)
            add_normal_force(k, F_n, of(per_newton, k), normal_force_out)
            spring.face[s] = b
            spring.stiffness[s] = stiffness
            spring.weight[s] = met.weight[s]
            spring.held[s] = -gap
            if -gap > wp.float64(REACH) * wp.min(slave.size[a], master.size[b]):
                flag_out[k, TOO_DEEP] = 1
        elif spring.face[s] >= 0:
            if met.taken[s] == wp.static(NOBODY):
                g = spring.face[s]
                w = spring.weight[s]
                du = w[0] * v[slave.node[a, 0]] + w[1] * v[slave.node[a, 1]]
                du = du - w[2] * v[master.node[g, 0]] - w[3] * v[master.node[g, 1]]
                open_contact(s, dt * du, spring.stiffness[s], spring)
            else:  # another spring has all that it held
                spring.energy[s] = wp.float64(0.0)
                spring.normal_energy[s] = wp.float64(0.0)
                spring.owed[s] = wp.float64(0.0)
                spring.force[s] = wp.vec3d()
                spring.tangential[s] = wp.vec3d()
                spring.face[s] = -1
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
                        if spring.face[s] >= 0:
                            w = spring.weight[s]
                            total += w[end] * spring.force[s]
                else:  # edges of the master are counted down from -1
                    f = -1 - e
                    end = wp.where(master.node[f, 1] == i, 3, 2)
                    for q in range(wp.min(edge_count[f], edge_slave.shape[1])):
                        a = edge_slave[f, q]
                        for s in range(wp.static(SLOTS) * a, wp.static(SLOTS) * (a + 1)):
                            if spring.face[s] == f:
                                w = spring.weight[s]
                                total -= w[end] * spring.force[s]
            if wp.length_sq(total) > wp.float64(0.0):
                nodal_force_out[i] = nodal_force_out[i] + total

    return share_edges
