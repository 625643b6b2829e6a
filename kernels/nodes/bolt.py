"""Owns what bolts have beside their springs: how they are tightened, and the forces in their shanks.

While a bolt is tightened, L_0 of its straight springs follows their mean elongation, and that of the slanted ones
theirs, so that along the shank nothing but the preload pulls; against shear and bending it is as stiff as ever. The
preload grows as P s^2 (3 - 2 s) over the share s of its rise. What tightens a bolt does the external work

    dW = (e - r) dP - T dL_0,

with the elongation r at which the springs store no energy: what they store, and what they do on the bodies.
"""

import warp as wp

from warp_mca.kernels.nodes.spring import Springs, direction_of, ends_of, table_at

GROUPS = wp.vec2d(3.0, 6.0)  # straight and slanted springs of a bolt


@wp.struct
class Shanks:
    """What tightens bolts.

    Attributes:
        begin: first spring of each, and the number of all, shape (bolt_count + 1,), int32.
        length: L_0 of each spring before [m], shape (spring_count,), float64.
        preload: of each at the end [N], shape (spring_count,), float64.
        slanted: 1 of slanted ones, else 0 [-], shape (spring_count,), int32.
        rise: time in which the preload grows [s], shape (bolt_count,), float64.
        tightens: 1 while it does [-], shape (1,), int32.
    """

    begin: wp.array(dtype=wp.int32)
    length: wp.array(dtype=wp.float64)
    preload: wp.array(dtype=wp.float64)
    slanted: wp.array(dtype=wp.int32)
    rise: wp.array(dtype=wp.float64)
    tightens: wp.array(dtype=wp.int32)


@wp.struct
class ShankState:
    """What tightened bolts keep.

    Attributes:
        length: L_0 of each spring [m], shape (spring_count,), float64.
        preload: of each [N], shape (spring_count,), float64.
        turned: time for which each bolt has been tightened [s], shape (bolt_count,), float64.
        work: W [J], shape (spring_count,), float64.
    """

    length: wp.array(dtype=wp.float64)
    preload: wp.array(dtype=wp.float64)
    turned: wp.array(dtype=wp.float64)
    work: wp.array(dtype=wp.float64)


@wp.func
def force_at(j: int, springs: Springs, P: wp.float64, e: wp.float64) -> wp.float64:
    """Tension of spring j with a preload and an elongation."""
    stiff = table_at(springs.tables[2 * j], springs.tables[2 * j + 1], springs.x, springs.y, e)
    return P + stiff[0]


@wp.kernel(enable_backward=False)
def stretch_bolts(
    springs: Springs, tightens: wp.array(dtype=wp.int32), u: wp.array(dtype=wp.vec3d), L_out: wp.array(dtype=wp.float64)
):
    """Find the length of each spring [m] while bolts are tightened, a block of threads for each."""
    j, lane = wp.tid()
    if tightens[0] > 0:
        L = wp.length(springs.between[j] + ends_of(j, lane, springs.points, u))
        if lane == 0:
            L_out[j] = L


@wp.kernel(enable_backward=False)
def tighten_bolts(
    springs: Springs,
    shanks: Shanks,
    elongation: wp.array(dtype=wp.float64),
    L: wp.array(dtype=wp.float64),
    dt: wp.float64,
    state_out: ShankState,
):
    """Let L_0 follow mean elongations, and the preload grow, a thread for each bolt; at the start dt is 0.

    `elongation` is e of each spring a step before [m], `L` its length [m], shape (spring_count,).
    """
    b = wp.tid()
    if shanks.tightens[0] > 0:
        mean = wp.vec2d()
        for j in range(shanks.begin[b], shanks.begin[b + 1]):
            k = shanks.slanted[j]
            mean[k] += (L[j] - shanks.length[j]) / wp.static(GROUPS)[k]
        turned = state_out.turned[b] + dt
        s = wp.min(turned / shanks.rise[b], wp.float64(1.0))
        grown = s * s * (wp.float64(3.0) - wp.float64(2.0) * s)
        for j in range(shanks.begin[b], shanks.begin[b + 1]):
            before = state_out.preload[j]
            P = grown * shanks.preload[j]
            L_0 = shanks.length[j] + mean[shanks.slanted[j]]
            e = L[j] - L_0
            T = wp.float64(0.5) * (force_at(j, springs, before, elongation[j]) + force_at(j, springs, P, e))
            work = (P - before) * (wp.float64(0.5) * (e + elongation[j]) - springs.rest[j])
            state_out.work[j] = state_out.work[j] + work - T * (L_0 - state_out.length[j])
            state_out.length[j] = L_0
            state_out.preload[j] = P
        state_out.turned[b] = turned


@wp.kernel(enable_backward=False)
def read_bolts(
    begin: wp.array(dtype=wp.int32),
    springs: Springs,
    tension: wp.array(dtype=wp.float64),
    u: wp.array(dtype=wp.vec3d),
    axial_out: wp.array(dtype=wp.float64),
    shear_out: wp.array(dtype=wp.float64),
):
    """Axial and shear force of bolts, whose springs begin at `begin`; their mean direction is that of the shank."""
    b, lane = wp.tid()
    force = wp.vec3d()
    axis = wp.vec3d()
    for j in range(begin[b], begin[b + 1]):
        n = direction_of(j, springs, springs.between[j] + ends_of(j, lane, springs.points, u), wp.float64(0.0))
        force += tension[j] * n
        axis += n
    if lane == 0:
        axis = wp.normalize(axis)
        axial = wp.dot(force, axis)
        axial_out[b] = axial
        shear_out[b] = wp.length(force - axial * axis)
