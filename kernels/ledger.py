"""Owns the sums of the energy ledger, of each scene apart: each thread adds every `width`-th entry, in fixed order."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.scalars import scalars

wp.set_module_options({"enable_backward": False})


@wp.kernel(enable_backward=False)
def sum_nodes(
    mass: wp.array(dtype=wp.float64),
    gravity: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v_before: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    width: int,
    first: wp.array(dtype=wp.int32),
    wide_out: wp.array3d(dtype=wp.float64),
):
    """Kinetic energy v(n-1/2) . M v(n+1/2) / 2, which central differences keep exactly, and gravity's work at t(n).

    `first` is the first node of each scene.
    """
    scene, k = wp.tid()
    kinetic = wp.float64(0.0)
    work = wp.float64(0.0)
    for i in range(first[scene] + k, first[scene + 1], width):
        kinetic += wp.float64(0.5) * mass[i] * wp.dot(v_before[i], v[i])
        work += mass[i] * wp.dot(gravity[scene], u[i] - dt * v[i])
    wide_out[scene, 0, k] = kinetic
    wide_out[scene, 1, k] = work


@wp.kernel(enable_backward=False)
def sum_scalars(
    value: wp.array(dtype=wp.float64),
    row: wp.array(dtype=wp.int32),
    column: int,
    width: int,
    first: wp.array(dtype=wp.int32),
    partial_out: wp.array4d(dtype=wp.float64),
):
    """Sum of one array, whose entries of each scene begin at `first`."""
    scene, k = wp.tid()
    total = wp.float64(0.0)
    for i in range(first[scene] + k, first[scene + 1], width):
        total += value[i]
    partial_out[row[0], scene, column, k] = total


@cache
def sum_elements_kernel(precision: str) -> Any:
    """Kernel: sums of elastic, plastic and hourglass energy; extremes of strain and Jacobian ratio.

    `ranges` are first and end of the elements of each scene in each block. The order is that of the scene alone.
    """
    R = scalars(precision).real

    @wp.kernel(enable_backward=False, module="unique")
    def sum_elements(
        energy: wp.array2d(dtype=R),
        width: int,
        ranges: wp.array3d(dtype=wp.int32),
        wide_out: wp.array3d(dtype=wp.float64),
    ):
        scene, k = wp.tid()
        elastic = wp.float64(0.0)
        plastic = wp.float64(0.0)
        hourglass = wp.float64(0.0)
        largest = wp.float64(0.0)
        smallest = wp.float64(1.0)
        start = int(k)  # of this thread's entries in a block
        for b in range(ranges.shape[1]):
            end = ranges[scene, b, 1]
            for e in range(ranges[scene, b, 0] + start, end, width):
                elastic += wp.float64(energy[0, e])
                plastic += wp.float64(energy[1, e])
                hourglass += wp.float64(energy[4, e])
                largest = wp.max(largest, wp.float64(energy[2, e]))
                smallest = wp.min(smallest, wp.float64(energy[3, e]))
            start -= (end - ranges[scene, b, 0]) % width
            if start < 0:
                start += width
        wide_out[scene, 2, k] = elastic
        wide_out[scene, 3, k] = plastic
        wide_out[scene, 4, k] = largest
        wide_out[scene, 5, k] = smallest
        wide_out[scene, 6, k] = hourglass

    return sum_elements


@wp.kernel(enable_backward=False)
def fold(
    wide: wp.array3d(dtype=wp.float64),
    row: wp.array(dtype=wp.int32),
    width: int,
    partial_out: wp.array4d(dtype=wp.float64),
):
    """Fold the sums and extremes of many threads into those of `width`: the first columns of a record."""
    scene, k = wp.tid()
    for column in range(wide.shape[1]):
        value = wide[scene, column, k]
        for j in range(k + width, wide.shape[2], width):
            if column == 4:
                value = wp.max(value, wide[scene, column, j])
            elif column == 5:
                value = wp.min(value, wide[scene, column, j])
            else:
                value += wide[scene, column, j]
        partial_out[row[0], scene, column, k] = value


@wp.kernel(enable_backward=False)
def record_points(
    node: wp.array(dtype=wp.int32),
    v_before: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    row: wp.array(dtype=wp.int32),
    point_out: wp.array2d(dtype=wp.vec3d),
):
    """Velocity at t(n) of the recorded nodes: the mean of the half steps around it."""
    k = wp.tid()
    i = node[k]
    point_out[row[0], k] = wp.float64(0.5) * (v_before[i] + v[i])


@wp.kernel(enable_backward=False)
def advance_row(rows: int, row_out: wp.array(dtype=wp.int32)):
    """Next row of the ring of records."""
    row_out[0] = (row_out[0] + 1) % rows
