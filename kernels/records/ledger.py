"""Owns the sums of the energy ledger, for each scene separately, in a fixed order.

Entries of a scene are cut into SUM_WIDTH equal runs at most, whose sums a record keeps separately. On a GPU the threads
of a block share a run and add up their parts in a fixed order; on a CPU a block is one thread.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.block import block_sum
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.records.columns import (
    DRIVE_WORK,
    ELASTIC,
    GRAVITY_WORK,
    HOURGLASS,
    JACOBIAN,
    KINETIC,
    PLASTIC,
    STRAIN,
    VISCOUS,
)

SUM_WIDTH = 256  # runs of a scene at most
RUN = 256  # least number of entries of a run, one for each thread of a block


@wp.func
def run_of(first: int, end: int, k: int):
    """Beginning and end of the k-th run of the entries [first, end); runs beyond the last are empty."""
    size = wp.max((end - first + wp.static(SUM_WIDTH - 1)) // wp.static(SUM_WIDTH), wp.static(RUN))
    begin = wp.min(first + k * size, end)
    return begin, wp.min(begin + size, end)


@wp.kernel(enable_backward=False)
def record_motion(
    row: wp.array(dtype=wp.int32),
    mass: wp.array(dtype=wp.float64),
    heavy_mass: wp.array(dtype=wp.float64),
    gravity: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v_before: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    first: wp.array(dtype=wp.int32),
    drive_work: wp.array(dtype=wp.vec3d),
    driven_first: wp.array(dtype=wp.int32),
    point: wp.array(dtype=wp.int32),
    partial_out: wp.array4d(dtype=wp.float64),
    point_out: wp.array2d(dtype=wp.vec3d),
):
    """Kinetic energy v(n-1/2) . M v(n+1/2) / 2, which central differences keep exactly, and works done up to t(n).

    Recorded nodes have the mean velocity of the half steps around t(n). `first` and `driven_first` are the first node
    and the first driven node of each scene.
    """
    scene, k, lane = wp.tid()
    r = row[0]
    g = gravity[scene]
    weightless = wp.dot(g, g) == wp.float64(0.0)
    kinetic = wp.float64(0.0)
    fall = wp.float64(0.0)
    begin, end = run_of(first[scene], first[scene + 1], k)
    for i in range(begin + lane, end, wp.block_dim()):
        m = mass[i]
        v_i = v[i]
        kinetic += wp.float64(0.5) * m * wp.dot(v_before[i], v_i)
        if not weightless:
            fall += heavy_mass[i] * wp.dot(g, u[i] - dt * v_i)
    driven = wp.float64(0.0)
    begin, end = run_of(driven_first[scene], driven_first[scene + 1], k)
    for i in range(begin + lane, end, wp.block_dim()):
        w = drive_work[i]
        driven += w[0] + w[1] + w[2]
    if scene == 0 and k == 0:
        for p in range(lane, point.shape[0], wp.block_dim()):
            point_out[r, p] = wp.float64(0.5) * (v_before[point[p]] + v[point[p]])
    kinetic = block_sum(kinetic)
    fall = block_sum(fall)
    driven = block_sum(driven)
    if lane == 0:
        partial_out[r, scene, wp.static(KINETIC), k] = kinetic
        partial_out[r, scene, wp.static(GRAVITY_WORK), k] = fall
        partial_out[r, scene, wp.static(DRIVE_WORK), k] = driven


@cache
def sum_elements_kernel(precision: str, viscous: bool = False) -> Any:
    """Kernel: sums of elastic, plastic and hourglass energy; extremes of strain and Jacobian ratio; viscosity's energy.

    `ranges` are first and end of the elements of each scene in each block. Runs continue from one block to the next, so
    that the order of summation does not depend on the other scenes of a batch.
    """
    R = scalars(precision).real

    @wp.kernel(enable_backward=False, module="unique")
    def sum_elements(
        row: wp.array(dtype=wp.int32),
        energy: wp.array2d(dtype=R),
        ranges: wp.array3d(dtype=wp.int32),
        partial_out: wp.array4d(dtype=wp.float64),
    ):
        scene, k, lane = wp.tid()
        elastic = wp.float64(0.0)
        plastic = wp.float64(0.0)
        hourglass = wp.float64(0.0)
        taken = wp.float64(0.0)
        largest = R(0.0)
        smallest = R(1.0)
        count = int(0)
        for b in range(ranges.shape[1]):
            count += ranges[scene, b, 1] - ranges[scene, b, 0]
        begin, end = run_of(0, count, k)
        for b in range(ranges.shape[1]):
            first = ranges[scene, b, 0]
            size = ranges[scene, b, 1] - first
            for e in range(first + wp.max(begin, 0) + lane, first + wp.min(end, size), wp.block_dim()):
                elastic += wp.float64(energy[0, e])
                plastic += wp.float64(energy[1, e])
                hourglass += wp.float64(energy[4, e])
                if wp.static(viscous):
                    taken += wp.float64(energy[5, e])
                largest = wp.max(largest, energy[2, e])
                smallest = wp.min(smallest, energy[3, e])
            begin -= size
            end -= size
        elastic = block_sum(elastic)
        plastic = block_sum(plastic)
        hourglass = block_sum(hourglass)
        if wp.static(viscous):
            taken = block_sum(taken)
        greatest = wp.tile_max(wp.tile(largest))
        least = wp.tile_min(wp.tile(smallest))
        if lane == 0:
            r = row[0]
            partial_out[r, scene, wp.static(ELASTIC), k] = elastic
            partial_out[r, scene, wp.static(PLASTIC), k] = plastic
            partial_out[r, scene, wp.static(STRAIN), k] = wp.float64(greatest[0])
            partial_out[r, scene, wp.static(JACOBIAN), k] = wp.float64(least[0])
            partial_out[r, scene, wp.static(HOURGLASS), k] = hourglass
            if wp.static(viscous):
                partial_out[r, scene, wp.static(VISCOUS), k] = taken

    return sum_elements


@wp.kernel(enable_backward=False)
def advance_row(rows: int, row_out: wp.array(dtype=wp.int32)):
    """Next row of the ring of records."""
    row_out[0] = (row_out[0] + 1) % rows
