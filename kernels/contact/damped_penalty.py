"""Owns the linear contact law with a dashpot: F_n = k (g + tau r), r the rate of approach, no more than a bound.

See `warp_mca.kernels.contact.laws`.
"""

import warp as wp

from warp_mca.kernels.contact import penalty

force, energy = penalty.force, penalty.energy


@wp.func
def dashpot(
    depth: wp.float64, rate: wp.float64, k: wp.float64, parameters: wp.array2d(dtype=wp.float64), s: int
) -> wp.float64:
    """k tau r [N], with tau [s] and the bound on r [m/s] in `parameters`."""
    return k * parameters[s, 0] * wp.clamp(rate, -parameters[s, 1], parameters[s, 1])
