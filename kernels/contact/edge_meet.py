"""Owns which edges press each other in a step: crossings that begin, and those that go on between other edges."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.balance import compression_kept
from warp_mca.kernels.contact.edge_pairs import (
    SLOTS,
    Crossing,
    SkinEdges,
    crossing,
    goes_on,
    lies_clear,
    resting_depth,
    share_an_end,
)
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.contact.switching import face_left

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
        force, tangential, stiffness, energy: of the spring `before` in the last step [N], [N/m], [J].
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
                        if not crossing(X, u, v, slave, master, other, g, wp.float64(0.0), True).within:
                            best = r
                            depth = spring.held[r]
    return best


@wp.func
def begin_crossing(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    slave: SkinEdges,
    master: SkinEdges,
    a: int,
    b: int,
    before: int,
    hit: Crossing,
    spring: Spring,
):
    """Whether a spring begins where edges a and b cross, from spring `before` or anew; its resting depth [m].

    A node at the crossing that lies behind both faces beside the other edge meets one of these by itself if that is
    about as the edges press. Else that face pushes it aside, and in a one-way contact none presses one of the master.
    """
    size = wp.min(slave.size[a], master.size[b])
    if before >= 0:
        pressed = spring.force[before] - spring.tangential[before]
        stored, k = spring.normal_energy[before], spring.stiffness[before]
        kept = compression_kept(stored, pressed, hit.du, hit.normal, k)
        rests = wp.max(-hit.gap - kept, wp.float64(0.0))
        return goes_on(-hit.gap, spring.held[before], hit.approach, size), rests
    rest = resting_depth(-hit.gap, hit.approach, size)
    begins = rest >= wp.float64(0.0)
    first_touch = hit.amid and rest == wp.float64(0.0)
    if begins and not first_touch:
        begins = lies_clear(X, u, slave, a, master, b, hit.weight[1], size)
    if begins and not first_touch:
        begins = lies_clear(X, u, master, b, slave, a, hit.weight[3], size)
    # no more compression than the step explains: springs that begin with more make energy
    return begins, wp.max(rest, -hit.gap - wp.max(hit.approach, wp.float64(0.0)))


@wp.func
def free_place(begin: int, end: int, b: int, spring: Spring, met: Met) -> int:
    """The spring of an edge for a new crossing with edge b: the one that left b, a free one, or any open one."""
    place, left = int(-1), int(-1)
    for s in range(end - 1, begin - 1, -1):
        if spring.face[s] < 0 and met.edge[s] < 0:
            own = face_left(spring.face[s])
            if place < 0 or own == b or (own < 0 and left != b):
                place = s
                left = own
    return place


@wp.func
def offer(place: int, before: int, spring: Spring, met_out: Met):
    """Offer what spring `before` holds to spring `place`; of several, the first one gets it."""
    wp.atomic_min(met_out.taken, before, place)
    met_out.force[place] = spring.force[before]
    met_out.tangential[place] = spring.tangential[before]
    met_out.stiffness[place] = spring.stiffness[before]
    met_out.energy[place] = spring.energy[before]


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
                before = place
                begins = place >= 0
                rest = wp.float64(0.0)
                if place < 0:
                    before = predecessor(X, u, v, slave, master, chains, a, b, hit.normal, spring)
                    begins, rest = begin_crossing(X, u, slave, master, a, b, before, hit, spring)
                if begins and place < 0:
                    place = free_place(begin, end, b, spring, met_out)
                if begins and place >= 0:
                    met_out.edge[place] = b
                    met_out.before[place] = before
                    met_out.weight[place] = hit.weight
                    met_out.normal[place] = hit.normal
                    met_out.gap[place] = hit.gap
                    met_out.du[place] = hit.du
                    met_out.rest[place] = rest
                    if before >= 0 and before != place:
                        offer(place, before, spring, met_out)

    return meet_edges
