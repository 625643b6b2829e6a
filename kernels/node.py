"""Owns the nodal stage: forces gathered from the elements, velocity and displacement advanced, bound nodes held."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.constraint import DRIVEN, FOLLOWS, LEADS, Bonds, count_impulse, drive, weighted_mean
from warp_mca.kernels.each import kind, value_function
from warp_mca.kernels.scalars import scalars

wp.set_module_options({"enable_backward": False})


@cache
def gather_function(precision: str, contact: bool) -> Any:
    """The function that sums the forces on a node, its contact force included, which it clears."""
    vec3 = scalars(precision).vec3

    @wp.func
    def gather(
        i: int,
        offset: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        force: wp.array(dtype=vec3),
        contact_force_out: wp.array(dtype=wp.vec3d),
    ):
        total = wp.vec3d()
        for j in range(offset[i], offset[i + 1]):
            f = force[slot[j]]
            total += wp.vec3d(wp.float64(f[0]), wp.float64(f[1]), wp.float64(f[2]))
        if wp.static(contact):
            fc = contact_force_out[i]
            if fc[0] != wp.float64(0.0) or fc[1] != wp.float64(0.0) or fc[2] != wp.float64(0.0):
                total += fc
                contact_force_out[i] = wp.vec3d()
        return total

    return gather


@cache
def integrate_kernel(
    precision: str, contact: bool, fixed: bool, hinged: bool = False, driven: bool = False, each: bool = False
) -> Any:
    """Kernel: central difference with lumped mass. v(n+1/2) = v(n-1/2) + kick a(n); u(n+1) = u(n) + drift v(n+1/2).

    Each node sums its element forces in the fixed order of a compressed list, so that runs repeat bit for bit.
    `hinged`: coincident pairs take their mass-weighted mean motion, moved by the thread of the first; a pair without a
    second node is held by the ground. `driven`: some axes follow a table. No node is both, nor at rest and in a hinge.
    With `each`, gravity differs between the scenes of a batch, and nodes know their scene. Nodes are those from `start`
    on.
    """
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)
    vec3 = scalars(precision).vec3
    gather = gather_function(precision, contact)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def integrate(
        start: int,
        inverse_mass: wp.array(dtype=wp.float64),
        offset: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        force: wp.array(dtype=vec3),
        scene: Index,
        gravity: Vector,
        bonds: Bonds,
        kick: wp.float64,
        drift: wp.float64,
        contact_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        impulse_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
        work_after_out: wp.array(dtype=wp.vec3d),
        clock_out: wp.array(dtype=wp.int32),
    ):
        i = start + wp.tid()
        role = int(0)
        if wp.static(fixed or hinged or driven):
            role = int(bonds.role[i])
        if wp.static(hinged):
            if role == wp.static(FOLLOWS):
                return
        total = gather(i, offset, slot, force, contact_force_out)
        a = inverse_mass[i] * total + of(gravity, of(scene, i))
        if wp.static(fixed):
            for k in range(3):
                if (role >> k) & 1 != 0:
                    a[k] = wp.float64(0.0)
        v = v_out[i] + kick * a
        u = u_out[i] + drift * v
        if wp.static(hinged):
            if role == wp.static(LEADS):
                pair = bonds.entry[i]
                j = bonds.second[pair]
                free = v
                v = wp.vec3d()
                u_first = u
                u = wp.vec3d()
                if j >= 0:
                    total = gather(j, offset, slot, force, contact_force_out)
                    v_j = v_out[j] + kick * (inverse_mass[j] * total + of(gravity, of(scene, j)))
                    u_j = u_out[j] + drift * v_j
                    v = weighted_mean(bonds.mass[i], free, bonds.mass[j], v_j)
                    u = weighted_mean(bonds.mass[i], u_first, bonds.mass[j], u_j)
                    v_out[j] = v
                    u_out[j] = u
                count_impulse(pair, bonds.mass[i], v, free, impulse_out)
        if wp.static(driven):
            if role >= wp.static(DRIVEN):
                free = v
                v = drive(bonds.entry[i], bonds.mass[i], drift, bonds, free, work_out, work_after_out, clock_out)
                u += drift * (v - free)
        v_out[i] = v
        u_out[i] = u

    return integrate
