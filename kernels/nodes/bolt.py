"""Owns what bolts have beside their springs: how they are tightened, and the forces in their shanks.

While a bolt is tightened, L_0 of its springs follows their length L, so that nothing but the preload pulls. That grows
as P s^2 (3 - 2 s) over the share s of its rise. What tightens a bolt does the external work

    dW = -r dP - P dL,

with the elongation r at which the springs store no energy: what they store, and what they do on the bodies.
"""

import warp as wp

from warp_mca.kernels.nodes.spring import Springs, between_ends, direction_of


@wp.struct
class Shanks:
    """What tightens bolts.

    Attributes:
        preload: of each spring at the end [N], shape (spring_count,), float64.
        rise: time in which it grows [s], shape (spring_count,), float64.
        tightens: 1 while it does [-], shape (1,), int32.
    """

    preload: wp.array(dtype=wp.float64)
    rise: wp.array(dtype=wp.float64)
    tightens: wp.array(dtype=wp.int32)


@wp.struct
class ShankState:
    """What tightened bolts keep.

    Attributes:
        length: L_0 of each spring [m], shape (spring_count,), float64.
        preload: of each [N], shape (spring_count,), float64.
        turned: time for which it has been tightened [s], shape (spring_count,), float64.
        work: W [J], shape (spring_count,), float64.
    """

    length: wp.array(dtype=wp.float64)
    preload: wp.array(dtype=wp.float64)
    turned: wp.array(dtype=wp.float64)
    work: wp.array(dtype=wp.float64)


@wp.kernel(enable_backward=False)
def tighten_bolts(
    springs: Springs,
    shanks: Shanks,
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    state_out: ShankState,
):
    """Let L_0 follow L and the preload grow, a block of threads for each spring; at the start dt is 0."""
    j, lane = wp.tid()
    if shanks.tightens[0] > 0:
        L = wp.length(between_ends(j, lane, springs, X, u))
        if lane == 0:
            turned = state_out.turned[j] + dt
            s = wp.min(turned / shanks.rise[j], wp.float64(1.0))
            before = state_out.preload[j]
            P = shanks.preload[j] * s * s * (wp.float64(3.0) - wp.float64(2.0) * s)
            way = L - state_out.length[j]
            work = (before - P) * springs.rest[j] - wp.float64(0.5) * (before + P) * way
            state_out.work[j] = state_out.work[j] + work
            state_out.length[j] = L
            state_out.preload[j] = P
            state_out.turned[j] = turned


@wp.kernel(enable_backward=False)
def read_bolts(
    begin: wp.array(dtype=wp.int32),
    springs: Springs,
    tension: wp.array(dtype=wp.float64),
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    axial_out: wp.array(dtype=wp.float64),
    shear_out: wp.array(dtype=wp.float64),
):
    """Axial and shear force of bolts, whose springs begin at `begin`; their mean direction is that of the shank."""
    b, lane = wp.tid()
    force = wp.vec3d()
    axis = wp.vec3d()
    for j in range(begin[b], begin[b + 1]):
        n = direction_of(j, springs, between_ends(j, lane, springs, X, u), wp.float64(0.0))
        force += tension[j] * n
        axis += n
    if lane == 0:
        axis = wp.normalize(axis)
        axial = wp.dot(force, axis)
        axial_out[b] = axial
        shear_out[b] = wp.length(force - axial * axis)
