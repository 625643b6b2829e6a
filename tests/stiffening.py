"""Owns a contact law of the user's own: F = k g_0 (g / g_0)^(3/2), a spring that stiffens with the root of its depth.

See `warp_mca.kernels.contact.laws`.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def force(depth: wp.float64, k: wp.float64, parameters: wp.array2d(dtype=wp.float64), s: int) -> wp.float64:
    """k g_0 (g / g_0)^(3/2) [N]."""
    return k * depth * wp.sqrt(depth / parameters[s, 0])


@wp.func
def energy(depth: wp.float64, k: wp.float64, parameters: wp.array2d(dtype=wp.float64), s: int) -> wp.float64:
    """2 / 5 k g_0^2 (g / g_0)^(5/2) [J]."""
    return wp.float64(0.4) * depth * force(depth, k, parameters, s)
