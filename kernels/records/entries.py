"""Owns sums of entries of an array, and entries one by one, of each scene apart."""

import warp as wp

from warp_mca.kernels.records.ledger import run_of


@wp.kernel(enable_backward=False)
def sum_entries(
    row: wp.array(dtype=wp.int32),
    column: int,
    first: wp.array(dtype=wp.int32),
    entry: wp.array(dtype=wp.float64),
    partial_out: wp.array4d(dtype=wp.float64),
):
    """Sum the entries of each scene, which begin at `first`, into a column; sums are those of `records.ledger`."""
    scene, k, lane = wp.tid()
    total = wp.float64(0.0)
    begin, end = run_of(first[scene], first[scene + 1], k)
    for i in range(begin + lane, end, wp.block_dim()):
        total += entry[i]
    found = wp.tile_sum(wp.tile(total))
    if lane == 0:
        partial_out[row[0], scene, column, k] = found[0]


@wp.kernel(enable_backward=False)
def list_entries(
    row: wp.array(dtype=wp.int32),
    column: int,
    first: wp.array(dtype=wp.int32),
    entry: wp.array(dtype=wp.float64),
    partial_out: wp.array4d(dtype=wp.float64),
):
    """Each entry of a scene in a column of its own, from `column` on."""
    i = wp.tid()
    scene = int(0)
    while i >= first[scene + 1]:
        scene += 1
    partial_out[row[0], scene, column + i - first[scene], 0] = entry[i]
