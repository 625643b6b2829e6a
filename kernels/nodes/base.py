"""Owns the base of a chain: a carriage with the nodes of the ground hinge, which moves by a table or slides on a rail.

After the free step, these nodes and the carriage take one common velocity,

    v = b + e (e . (p / m - b)),

with b the velocity of the base at t(n+1/2), e the direction of the slide (0 without one), p the sum of their momenta
and m that of their masses. The rail gives no impulse along e, so that momentum along it is kept to rounding.
"""

import warp as wp

from warp_mca.kernels.nodes.constraint import table_mean
from warp_mca.kernels.records.extremes import keep_speed
from warp_mca.kernels.records.half_steps import add_half_steps


@wp.struct
class Bases:
    """The movable bases of a model.

    Attributes:
        begin, end: pairs of each base in `Bonds.first`, none for a hinge with a pin, shape (base_count,), int32.
        coupling: that hangs on each base, -1 without, shape (base_count,), int32.
        direction: e of each slide [-], shape (base_count,), vec3d.
        mass: of each carriage [kg], shape (base_count,), float64.
        gravity: on it [m/s^2], shape (base_count,), vec3d.
        table: first entry of each base's table, and the number of all, shape (base_count + 1,), int32.
        times, v_x, v_y: of all tables [s], [m/s], [m/s], float64.
    """

    begin: wp.array(dtype=wp.int32)
    end: wp.array(dtype=wp.int32)
    coupling: wp.array(dtype=wp.int32)
    direction: wp.array(dtype=wp.vec3d)
    mass: wp.array(dtype=wp.float64)
    gravity: wp.array(dtype=wp.vec3d)
    table: wp.array(dtype=wp.int32)
    times: wp.array(dtype=wp.float64)
    v_x: wp.array(dtype=wp.float64)
    v_y: wp.array(dtype=wp.float64)


@wp.func
def base_velocity(bases: Bases, k: int, n: int, dt: wp.float64) -> wp.vec3d:
    """Mean of b of base k over step n [m/s]."""
    start = wp.float64(n) * dt
    end = wp.float64(n + 1) * dt
    x = table_mean(bases.times, bases.v_x, bases.table[k], bases.table[k + 1], start, end)
    y = table_mean(bases.times, bases.v_y, bases.table[k], bases.table[k + 1], start, end)
    return wp.vec3d(x, y, wp.float64(0.0))


@wp.kernel(enable_backward=False)
def move_bases(
    bases: Bases,
    node: wp.array(dtype=wp.int32),
    mass: wp.array(dtype=wp.float64),
    latest: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    speed_square_out: wp.array(dtype=wp.float32),
    impulse_out: wp.array(dtype=wp.vec3d),
    carriage_out: wp.array(dtype=wp.vec3d),
    work_out: wp.array(dtype=wp.float64),
    work_after_out: wp.array(dtype=wp.float64),
    clock_out: wp.array(dtype=wp.int32),
    kinetic_out: wp.array(dtype=wp.float64),
):
    """Advance each carriage, and the nodes `node` of its ground hinge, once `bound_kernel` has advanced them as free.

    latest: impulse of each coupling on its first cluster in this step [N s], which its base gave; empty without.
    carriage_out: velocities of the carriages. work_out, work_after_out and clock_out are those of driven nodes, see
    `constraint.drive`, for the reaction across e; the work of the carriage's weight is in them. kinetic_out takes the
    kinetic energy of each carriage at t(n) [J], as `ledger.record_motion` has that of nodes.
    """
    k = wp.tid()
    e = bases.direction[k]
    n = clock_out[k]
    clock_out[k] = n + 1
    v_carriage = carriage_out[k]
    free = v_carriage + dt * bases.gravity[k]
    momentum = bases.mass[k] * free
    total = bases.mass[k]
    for pair in range(bases.begin[k], bases.end[k]):
        i = node[pair]
        momentum += mass[i] * v_out[i]
        total += mass[i]
    share = wp.float64(0.0)
    if bases.coupling[k] >= 0:
        momentum -= latest[bases.coupling[k]]
    if total > wp.float64(0.0):
        share = wp.dot(e, momentum) / total
    b = base_velocity(bases, k, n, dt)
    across = b - wp.dot(e, b) * e
    v = across + share * e
    b = base_velocity(bases, k, n - 1, dt)
    across_before = b - wp.dot(e, b) * e
    impulse = total * v - momentum
    half = wp.float64(0.5)
    add_half_steps(k, half * wp.dot(impulse, across_before), half * wp.dot(impulse, across), work_out, work_after_out)
    weight = bases.mass[k] * bases.gravity[k]
    work_after_out[k] = work_after_out[k] + dt * wp.dot(weight, v)
    kinetic_out[k] = wp.float64(0.5) * bases.mass[k] * wp.dot(v_carriage, v)
    for pair in range(bases.begin[k], bases.end[k]):
        i = node[pair]
        change = v - v_out[i]
        u_out[i] = u_out[i] + dt * change
        v_out[i] = v
        impulse_out[pair] = impulse_out[pair] + mass[i] * change
        keep_speed(i, v, speed_square_out)
    carriage_out[k] = v
