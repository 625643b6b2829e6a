"""Owns the sums of springs over the slaves of each scene: the columns of a contact pass in a record."""

import warp as wp

from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.records.columns import (
    DAMPED,
    FRICTION,
    IMPULSE,
    LOST,
    MADE,
    NORMAL_ENERGY,
    NORMAL_FORCE,
    NORMAL_IMPULSE,
    PASS_COLUMNS,
    PLANE_WORK,
    PRESSURE,
    SPRING_ENERGY,
    SQUARES,
    STICK_IMPULSE,
)
from warp_mca.kernels.records.ledger import run_of

Columns = wp.types.vector(length=PASS_COLUMNS, dtype=wp.float64)


@wp.kernel(enable_backward=False)
def sum_springs(
    row: wp.array(dtype=wp.int32),
    column: int,
    first: wp.array(dtype=wp.int32),
    afresh: bool,
    spring: Spring,
    partial_out: wp.array4d(dtype=wp.float64),
):
    """Sums over the slaves of each scene, which begin at `first`, into the columns of a pass, from `column` on.

    `records.columns` names them; they are summed as in `records.ledger`. With `afresh`, what is summed over an output
    interval then starts again from zero.
    """
    scene, k, lane = wp.tid()
    sums = Columns()
    impulse = wp.vec3d()
    pressed = wp.vec3d()
    pressed_energy = wp.float64(0.0)  # kept apart from `sums`, so that a GPU fuses product and sum
    begin, end = run_of(first[scene], first[scene + 1], k)
    for s in range(begin + lane, end, wp.block_dim()):
        held = spring.energy[s]
        sums[wp.static(SPRING_ENERGY)] += held
        if spring.face[s] >= 0:
            Ft = spring.tangential[s]
            Fn = spring.force[s] - Ft
            square = wp.dot(Fn, Fn)
            pressed += Fn
            sums[wp.static(PRESSURE)] += wp.sqrt(square)
            pressed_energy += spring.normal_energy[s]
            sums[wp.static(SQUARES)] += square
        sums[wp.static(FRICTION)] += spring.friction[s]
        sums[wp.static(PLANE_WORK)] += spring.drive[s]
        impulse += spring.impulse[s]
        sums[wp.static(NORMAL_IMPULSE)] += spring.normal_impulse[s]
        sums[wp.static(STICK_IMPULSE)] += spring.stick_impulse[s]
        sums[wp.static(LOST)] += spring.lost[s]
        sums[wp.static(MADE)] += spring.made[s]
        if spring.dashpot.shape[0] > 0:
            dashpot = spring.dashpot[s]
            sums[wp.static(DAMPED)] += dashpot[1]
        if afresh:
            spring.impulse[s] = wp.vec3d()
            spring.normal_impulse[s] = wp.float64(0.0)
            spring.stick_impulse[s] = wp.float64(0.0)
    sums[wp.static(NORMAL_ENERGY)] = pressed_energy
    for c in range(3):
        sums[wp.static(IMPULSE.start) + c] = impulse[c]
        sums[wp.static(NORMAL_FORCE.start) + c] = pressed[c]
    r = row[0]
    for c in range(wp.static(PASS_COLUMNS)):
        total = wp.tile_sum(wp.tile(sums[c]))
        value = total[0]  # executed by all threads, because reading a tile synchronises them
        if lane == 0:
            partial_out[r, scene, column + c, k] = value
