"""Owns the law of friction that caps the shear stress. See `warp_mca.kernels.contact.friction_laws`."""

import warp as wp


@wp.func
def limit(
    before: wp.float64, F_n: wp.float64, speed: wp.float64, parameters: wp.array2d(dtype=wp.float64), row: int
) -> wp.float64:
    """min(mu F_n, tau_max A) [N]; parameters: tau_max A [N]."""
    return wp.min(before, parameters[row, 0])
