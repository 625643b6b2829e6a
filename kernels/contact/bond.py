"""Owns bonds: springs that hold slave nodes to their places on the master's faces, in tension too, until they fail.

With d from the place to the node the force is f = -k d, along the line between the two points on which it acts, so
that angular momentum is kept. Its part along the face's normal n, F_n = f . n, and the other, F_t, fail together where
(max(-F_n, 0) / S_n)^2 + (F_t / S_t)^2 >= 1 with the `bond_limit` S. What is left then is the spring of an ordinary
contact, pressed by F_n if that is above 0; what the bond held besides is `lost`.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.balance import energy_made
from warp_mca.kernels.contact.edges import Surfaces, greatest_stiffness
from warp_mca.kernels.contact.nearest import Master, master_velocity
from warp_mca.kernels.contact.projection import area_vector, interpolate
from warp_mca.kernels.contact.search import list_slave
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.records.extremes import add_normal_force

HOLDS, FAILED = 1, -1  # in `Spring.bond`; 0 for springs that never had a bond


@wp.func
def offset(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    e: int,
    i: int,
    spring: Spring,
) -> wp.vec3d:
    """Vector from the place of spring e on its face to node i [m]."""
    f = spring.face[e]
    x = X[i] + u[i]
    corners = wp.vec4i(face[f, 0], face[f, 1], face[f, 2], face[f, 3])
    return -interpolate(
        spring.weight[e],
        X[corners[0]] + u[corners[0]] - x,
        X[corners[1]] + u[corners[1]] - x,
        X[corners[2]] + u[corners[2]] - x,
        X[corners[3]] + u[corners[3]] - x,
    )


@wp.func
def hold_bond(
    e: int,
    i: int,
    scene: int,
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    master: Master,
    own: wp.float64,
    per_newton: wp.float64,
    dt: wp.float64,
    spring: Spring,
    normal_force_out: wp.array(dtype=wp.int64),
) -> wp.vec3d:
    """Force [N] of bond e on node i, whose penalty stiffness is `own` [N/m]."""
    f = spring.face[e]
    half = wp.float64(0.5)
    zero = wp.float64(0.0)
    k = wp.min(own, master.stiffness[f])
    d = offset(X, u, master.face, e, i, spring)
    normal = wp.normalize(area_vector(X, u, master.face, f))
    du = dt * (v[i] - master_velocity(v, master.face, f, spring.weight[e]))
    force = -k * d
    F_n = wp.dot(force, normal)
    pressed = wp.max(F_n, zero)
    limit = spring.bond_limit[e]
    tension = wp.max(-F_n, zero) / limit[0]
    shear = wp.length(force - F_n * normal) / limit[1]
    stored = half * k * wp.dot(d, d)
    pressed_energy = half * pressed * pressed / k
    spent = zero
    if tension * tension + shear * shear >= wp.float64(1.0):
        force = pressed * normal
        spent = spring.energy[e] - pressed_energy - half * wp.dot(spring.force[e] + force, du)
        stored = pressed_energy
        spring.bond[e] = wp.static(FAILED)
        spring.lost[e] = spring.lost[e] + spent
        if pressed == zero:
            spring.face[e] = -1
    else:
        spring.bond_time[e] = spring.bond_time[e] + dt
    spring.made[e] = spring.made[e] + energy_made(spring.force[e], spring.energy[e], force, stored, spent, du)
    add_normal_force(scene, pressed, per_newton, normal_force_out)
    spring.stiffness[e] = k
    spring.rest[e] = zero
    spring.held[e] = pressed / k
    spring.energy[e] = stored
    spring.normal_energy[e] = pressed_energy
    spring.force[e] = force
    spring.tangential[e] = force - pressed * normal
    spring.impulse[e] = spring.impulse[e] + force
    spring.normal_impulse[e] = spring.normal_impulse[e] + pressed
    spring.stick_impulse[e] = spring.stick_impulse[e] + pressed
    spring.depth[e] = wp.max(spring.depth[e], pressed / k)
    return force


@wp.func
def hold_node(
    at: Surfaces,
    s: int,
    scene: int,
    begin: int,
    end: int,
    v: wp.array(dtype=wp.vec3d),
    per_newton: wp.float64,
    dt: wp.float64,
    spring: Spring,
    normal_force_out: wp.array(dtype=wp.int64),
):
    """The bond among springs `begin` to `end` - 1 of slave node s, which is clear of the other sides then.

    Returns the first spring that is left to press the node, `end` where a bond holds it, and the force on it [N].
    """
    force = wp.vec3d()
    bonded = int(-1)
    for e in range(begin, end):
        if spring.bond[e] == wp.static(HOLDS):
            bonded = e
    if bonded >= 0:
        for e in range(begin, end):
            spring.held[e] = wp.float64(0.0)
        own = greatest_stiffness(at, s, spring.face[bonded])
        i = at.slaves.node[s]
        force = hold_bond(bonded, i, scene, at.X, at.u, v, at.master, own, per_newton, dt, spring, normal_force_out)
    return wp.where(bonded >= 0, end, begin), force


@cache
def list_kernel(each: bool, sides: int) -> Any:
    """Kernel: put bonds that a search did not find into the lists of their faces, which gather the reactions."""
    of, Index = value_function(each), kind(wp.int32, each)

    @wp.kernel(enable_backward=False, module="unique")
    def list_bonds(
        scene: Index,
        count: wp.array(dtype=wp.int32),
        candidate: wp.array2d(dtype=wp.int32),
        spring: Spring,
        face_count_out: wp.array(dtype=wp.int32),
        face_slave_out: wp.array2d(dtype=wp.int32),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        e = wp.tid()
        if spring.bond[e] == wp.static(HOLDS):
            f = spring.face[e]
            listed = bool(False)
            for q in range(count[e]):
                listed = listed or candidate[e, q] == f
            if not listed:
                list_slave(f, e, of(scene, e // wp.static(sides)), face_count_out, face_slave_out, flag_out)

    return list_bonds
