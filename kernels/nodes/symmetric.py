"""Owns small symmetric systems of equations, some of whose rows may follow from others."""

import warp as wp

from warp_mca.kernels.hardware.block import wait_for_block

DEPENDENT = 1e-10  # a row is dependent if its pivot is below this share of its diagonal entry


@wp.func
def factorise(
    first: int,
    size: int,
    lane: int,
    begin: int,
    matrix_out: wp.array(dtype=wp.float64),
    share_out: wp.array(dtype=wp.float64),
):
    """Factorise a symmetric matrix as L D L^T in place, by all threads of a block. D is on the diagonal; it is 0 for
    dependent rows. share_out[begin:] is D over the diagonal entry: what of a row does not follow from those before."""
    for j in range(size):
        pivot = matrix_out[first + j * size + j]
        whole = pivot
        for k in range(j):
            x = matrix_out[first + j * size + k]
            pivot -= x * x * matrix_out[first + k * size + k]
        share = wp.float64(0.0)
        if pivot <= wp.float64(DEPENDENT) * whole:
            pivot = wp.float64(0.0)
        else:
            share = pivot / whole
        wait_for_block()
        if lane == 0:
            share_out[begin + j] = share
            matrix_out[first + j * size + j] = pivot
        for i in range(j + 1 + lane, size, wp.block_dim()):
            x = matrix_out[first + i * size + j]
            for k in range(j):
                y = matrix_out[first + j * size + k] * matrix_out[first + k * size + k]
                x -= matrix_out[first + i * size + k] * y
            if pivot > wp.float64(0.0):
                x = x / pivot
            else:
                x = wp.float64(0.0)
            matrix_out[first + i * size + j] = x
        wait_for_block()


@wp.func
def solve_factorised(
    first: int, size: int, begin: int, matrix: wp.array(dtype=wp.float64), value_out: wp.array(dtype=wp.float64)
):
    """Solve for the right-hand side in value_out[begin:]; dependent rows get 0."""
    for i in range(size):
        x = value_out[begin + i]
        for k in range(i):
            x -= matrix[first + i * size + k] * value_out[begin + k]
        value_out[begin + i] = x
    for i in range(size):
        pivot = matrix[first + i * size + i]
        if pivot > wp.float64(0.0):
            value_out[begin + i] = value_out[begin + i] / pivot
        else:
            value_out[begin + i] = wp.float64(0.0)
    for back in range(size):
        i = size - 1 - back
        x = value_out[begin + i]
        for k in range(i + 1, size):
            x -= matrix[first + k * size + i] * value_out[begin + k]
        value_out[begin + i] = x
