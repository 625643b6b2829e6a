"""Owns the nodal stage: forces gathered from the elements, velocity and displacement advanced."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.each import kind, value_function
from warp_mca.kernels.scalars import scalars

wp.set_module_options({"enable_backward": False})


@cache
def integrate_kernel(precision: str, contact: bool, fixed: bool, each: bool = False) -> Any:
    """Kernel: central difference with lumped mass. v(n+1/2) = v(n-1/2) + kick a(n); u(n+1) = u(n) + drift v(n+1/2).

    Each node sums its element forces in the fixed order of a compressed list, so that runs repeat bit for bit.
    With `each`, gravity differs between the scenes of a batch, and nodes know their scene.
    """
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)
    vec3 = scalars(precision).vec3

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def integrate(
        inverse_mass: wp.array(dtype=wp.float64),
        offset: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        fixed_axes: wp.array(dtype=wp.int32),
        force: wp.array(dtype=vec3),
        scene: Index,
        gravity: Vector,
        kick: wp.float64,
        drift: wp.float64,
        contact_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
    ):
        i = wp.tid()
        total = wp.vec3d()
        for j in range(offset[i], offset[i + 1]):
            f = force[slot[j]]
            total += wp.vec3d(wp.float64(f[0]), wp.float64(f[1]), wp.float64(f[2]))
        if wp.static(contact):
            fc = contact_force_out[i]
            if fc[0] != wp.float64(0.0) or fc[1] != wp.float64(0.0) or fc[2] != wp.float64(0.0):
                total += fc
                contact_force_out[i] = wp.vec3d()
        a = inverse_mass[i] * total + of(gravity, of(scene, i))
        if wp.static(fixed):
            axes = fixed_axes[i]
            if axes != 0:
                for k in range(3):
                    if (axes >> k) & 1 != 0:
                        a[k] = wp.float64(0.0)
        v = v_out[i] + kick * a
        v_out[i] = v
        u_out[i] = u_out[i] + drift * v

    return integrate
