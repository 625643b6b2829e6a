"""Owns the sums of the energy ledger: each thread adds every `width`-th entry, so that the order never changes."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.scalars import scalars

wp.set_module_options({"enable_backward": False})


@wp.kernel(enable_backward=False)
def sum_nodes(
    mass: wp.array(dtype=wp.float64),
    gravity: wp.vec3d,
    u: wp.array(dtype=wp.vec3d),
    v_before: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    width: int,
    wide_out: wp.array2d(dtype=wp.float64),
):
    """Kinetic energy v(n-1/2) . M v(n+1/2) / 2, which central differences keep exactly, and gravity's work at t(n)."""
    k = wp.tid()
    kinetic = wp.float64(0.0)
    work = wp.float64(0.0)
    for i in range(k, mass.shape[0], width):
        kinetic += wp.float64(0.5) * mass[i] * wp.dot(v_before[i], v[i])
        work += mass[i] * wp.dot(gravity, u[i] - dt * v[i])
    wide_out[0, k] = kinetic
    wide_out[1, k] = work


@wp.kernel(enable_backward=False)
def sum_scalars(
    value: wp.array(dtype=wp.float64),
    row: wp.array(dtype=wp.int32),
    column: int,
    width: int,
    partial_out: wp.array3d(dtype=wp.float64),
):
    """Sum of one array."""
    k = wp.tid()
    total = wp.float64(0.0)
    for i in range(k, value.shape[0], width):
        total += value[i]
    partial_out[row[0], column, k] = total


@cache
def sum_elements_kernel(precision: str) -> Any:
    """Kernel: sums of elastic, plastic and hourglass energy; extremes of strain and Jacobian ratio."""
    R = scalars(precision).real

    @wp.kernel(enable_backward=False, module="unique")
    def sum_elements(
        energy: wp.array2d(dtype=R),
        width: int,
        wide_out: wp.array2d(dtype=wp.float64),
    ):
        k = wp.tid()
        elastic = wp.float64(0.0)
        plastic = wp.float64(0.0)
        hourglass = wp.float64(0.0)
        largest = wp.float64(0.0)
        smallest = wp.float64(1.0)
        for e in range(k, energy.shape[1], width):
            elastic += wp.float64(energy[0, e])
            plastic += wp.float64(energy[1, e])
            hourglass += wp.float64(energy[4, e])
            largest = wp.max(largest, wp.float64(energy[2, e]))
            smallest = wp.min(smallest, wp.float64(energy[3, e]))
        wide_out[2, k] = elastic
        wide_out[3, k] = plastic
        wide_out[4, k] = largest
        wide_out[5, k] = smallest
        wide_out[6, k] = hourglass

    return sum_elements


@wp.kernel(enable_backward=False)
def fold(
    wide: wp.array2d(dtype=wp.float64),
    row: wp.array(dtype=wp.int32),
    width: int,
    partial_out: wp.array3d(dtype=wp.float64),
):
    """Fold the sums and extremes of many threads into those of `width`: the first columns of a record."""
    k = wp.tid()
    for column in range(wide.shape[0]):
        value = wide[column, k]
        for j in range(k + width, wide.shape[1], width):
            if column == 4:
                value = wp.max(value, wide[column, j])
            elif column == 5:
                value = wp.min(value, wide[column, j])
            else:
                value += wide[column, j]
        partial_out[row[0], column, k] = value


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
