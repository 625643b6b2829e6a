"""Owns what four lanes of a GPU that share an element of `hex8i` exchange.

Bits 0 and 1 of a lane are xi and eta of its corners and points.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import shared_functions

wp.set_module_options({"enable_backward": False})


@cache
def lane_functions(precision: str) -> tuple[Any, Any, Any, Any]:
    """Functions over the four lanes of an element, each of which knows its signs xi and eta.

    They take its lower and upper corners to the patterns of all; a tensor to its sums over the lanes, by itself and
    times xi, eta and xi eta; and a vector and a scalar to their sum and maximum.
    """
    t = scalars(precision)
    R, vec3, mat73 = t.real, t.vec3, t.mat73
    tensor = wp.types.vector(6, R)
    _, exchange = shared_functions(precision)

    @wp.func
    def other(x: vec3, mask: int):
        return vec3(exchange(x[0], mask), exchange(x[1], mask), exchange(x[2], mask))

    @wp.func
    def patterns(lower: vec3, upper: vec3, xi: R, eta: R):
        s = upper + lower
        d = upper - lower
        s1 = other(s, 1)
        d1 = other(d, 1)
        ss = s + s1
        sx = xi * (s - s1)
        ds = d + d1
        dx = xi * (d - d1)
        ss1 = other(ss, 2)
        sx1 = other(sx, 2)
        ds1 = other(ds, 2)
        dx1 = other(dx, 2)
        p = mat73()
        p[0] = sx + sx1
        p[1] = eta * (ss - ss1)
        p[2] = ds + ds1
        p[3] = eta * (ds - ds1)
        p[4] = dx + dx1
        p[5] = eta * (sx - sx1)
        p[6] = eta * (dx - dx1)
        return p

    @wp.func
    def sums(S: tensor, xi: R, eta: R):
        total = tensor()
        along = tensor()
        across = tensor()
        both = tensor()
        for i in range(6):
            if i != 2:  # zz of a traceless tensor follows
                s = exchange(S[i], 1)
                a = S[i] + s
                b = xi * (S[i] - s)
                a1 = exchange(a, 2)
                b1 = exchange(b, 2)
                total[i] = a + a1
                across[i] = eta * (a - a1)
                along[i] = b + b1
                both[i] = eta * (b - b1)
        total[2] = -total[0] - total[1]
        across[2] = -across[0] - across[1]
        along[2] = -along[0] - along[1]
        both[2] = -both[0] - both[1]
        return total, along, across, both

    @wp.func
    def vector_sum(x: vec3):
        x = x + other(x, 1)
        return x + other(x, 2)

    @wp.func
    def lane_max(value: R):
        value = wp.max(value, exchange(value, 1))
        return wp.max(value, exchange(value, 2))

    return patterns, sums, vector_sum, lane_max
