"""Owns the law of friction that decays from its coefficient at rest with the speed of sliding.

Oden and Martins, Comput. Methods Appl. Mech. Eng. 52 (1985) 527; LS-DYNA's FS, FD and DC. See
`warp_mca.kernels.contact.friction_laws`.
"""

import warp as wp


@wp.func
def limit(
    before: wp.float64, F_n: wp.float64, speed: wp.float64, parameters: wp.array2d(dtype=wp.float64), row: int
) -> wp.float64:
    """mu_k F_n + (mu F_n - mu_k F_n) exp(-d v) [N]; parameters: mu_k [-], d [s/m]."""
    kinetic = parameters[row, 0] * F_n
    return kinetic + (before - kinetic) * wp.exp(-parameters[row, 1] * speed)
