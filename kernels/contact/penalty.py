"""Owns the linear contact law: F_n = k g for the depth g. See `warp_mca.kernels.contact.laws`."""

import warp as wp


@wp.func
def force(depth: wp.float64, k: wp.float64, parameters: wp.array2d(dtype=wp.float64), s: int) -> wp.float64:
    """k g [N]."""
    return k * depth


@wp.func
def energy(depth: wp.float64, k: wp.float64, parameters: wp.array2d(dtype=wp.float64), s: int) -> wp.float64:
    """k g^2 / 2 [J]."""
    return wp.float64(0.5) * k * depth * depth
