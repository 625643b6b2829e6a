"""Owns the corners of two lanes of a GPU that share an element of `hex8i`, and what they exchange.

Bit 0 of a lane is xi of its corners and points; it has those of both eta, near ones (eta = -1) first.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.elements.patch import POINT, Patches
from warp_mca.kernels.elements.patch_element import load_functions
from warp_mca.kernels.elements.patterns import VOLUME_SCALE
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import ROW, shared_functions

wp.set_module_options({"enable_backward": False})


@cache
def lane_functions(precision: str) -> tuple[Any, Any, Any, Any]:
    """Functions over the two lanes of an element, each of which knows its sign xi.

    They take its lower and upper corners, near and far, to the patterns of all; a near and a far tensor to their sums
    over the lanes, by themselves and times xi, eta and xi eta; and a vector and a scalar to their sum and maximum.
    """
    t = scalars(precision)
    R, vec3, mat73 = t.real, t.vec3, t.mat73
    tensor = wp.types.vector(6, R)
    _, exchange = shared_functions(precision)

    @wp.func
    def other(x: vec3):
        return vec3(exchange(x[0], 1), exchange(x[1], 1), exchange(x[2], 1))

    @wp.func
    def patterns(near_lower: vec3, near_upper: vec3, far_lower: vec3, far_upper: vec3, xi: R):
        near_sum = near_upper + near_lower
        near_step = near_upper - near_lower
        far_sum = far_upper + far_lower
        far_step = far_upper - far_lower
        s = near_sum + far_sum
        s_eta = far_sum - near_sum
        d = near_step + far_step
        d_eta = far_step - near_step
        s1 = other(s)
        s1_eta = other(s_eta)
        d1 = other(d)
        d1_eta = other(d_eta)
        p = mat73()
        p[0] = xi * (s - s1)
        p[1] = s_eta + s1_eta
        p[2] = d + d1
        p[3] = d_eta + d1_eta
        p[4] = xi * (d - d1)
        p[5] = xi * (s_eta - s1_eta)
        p[6] = xi * (d_eta - d1_eta)
        return p

    @wp.func
    def sums(near: tensor, far: tensor, xi: R):
        total = tensor()
        along = tensor()
        across = tensor()
        both = tensor()
        for i in range(6):
            if i != 2:  # zz of a traceless tensor follows
                s = near[i] + far[i]
                d = far[i] - near[i]
                s1 = exchange(s, 1)
                d1 = exchange(d, 1)
                total[i] = s + s1
                along[i] = xi * (s - s1)
                across[i] = d + d1
                both[i] = xi * (d - d1)
        total[2] = -total[0] - total[1]
        across[2] = -across[0] - across[1]
        along[2] = -along[0] - along[1]
        both[2] = -both[0] - both[1]
        return total, along, across, both

    @wp.func
    def vector_sum(x: vec3):
        return x + other(x)

    @wp.func
    def lane_max(value: R):
        return wp.max(value, exchange(value, 1))

    return patterns, sums, vector_sum, lane_max


@cache
def corner_functions(precision: str) -> tuple[Any, Any]:
    """Functions of a lane's corners.

    (Points, pool, patches, e, lane, first, exponent, xi) -> patterns of the positions of all corners; (patterns x,
    gradients b, volume, W = Q - I, mean stress P, hourglass forces Q, xi, lane, thread, force_out) stores the forces.
    """
    t = scalars(precision)
    R, mat33, mat43, mat63, mat73 = t.real, t.mat33, t.mat43, t.mat63, t.mat73
    point, add_product = POINT[precision], fused(precision).add_product
    _, _, load_corners = load_functions(precision)
    patterns, _, _, _ = lane_functions(precision)

    @wp.func
    def load_patterns(
        points: wp.array(dtype=point),
        pool: wp.array(dtype=wp.vec3d),
        patches: Patches,
        e: int,
        lane: int,
        first: int,
        exponent: int,
        xi: R,
    ):
        x0, _d0, x1, _d1 = load_corners(points, pool, patches, e, lane, first, exponent)  # they run around the faces
        x2, _d2, x3, _d3 = load_corners(points, pool, patches, e, 3 - lane, first, exponent)
        return patterns(x0, x1, x2, x3, xi)

    @wp.func
    def store_pair(
        b: mat63, W: mat33, P: mat33, Q: mat43, xi: R, eta: R, a: int, lane: int, force_out: wp.array(dtype=R)
    ):
        # patterns of the forces, as the signs of the corners add them
        both = xi * eta
        base = add_product(both * Q[2], P, xi * b[0] + eta * b[1] + both * b[5])
        top = add_product(eta * Q[0] + xi * Q[1] + both * Q[3], P, b[2] + eta * b[3] + xi * b[4])
        base = add_product(base, W, base)
        top = add_product(top, W, top)
        for i in range(3):
            force_out[(3 * a + i) * wp.static(ROW) + lane] = top[i] - base[i]
            force_out[(3 * (a + 4) + i) * wp.static(ROW) + lane] = -base[i] - top[i]

    @wp.func
    def store_lane_forces(
        x: mat73,
        b: mat63,
        volume: R,
        W: mat33,
        P: mat33,
        Q: mat43,
        xi: R,
        lane: int,
        thread: int,
        force_out: wp.array(dtype=R),
    ):
        for n in range(4):  # amplitudes depend on the mean gradient, too
            P = P - wp.outer((R(1.0) / volume) * Q[n], x[3 + n])
        P = R(VOLUME_SCALE) * P
        store_pair(b, W, P, Q, xi, R(-1.0), lane, thread, force_out)
        store_pair(b, W, P, Q, xi, R(1.0), 3 - lane, thread, force_out)

    return load_patterns, store_lane_forces
